"""How fast steps are: cases as data, the machine's own limits measured beside them."""

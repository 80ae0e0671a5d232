"""One validation case per file; each module defines ``CASE``."""

"""Subcommands of ``warp-eulsph``, one per module: ``add`` its parser, ``run`` it and return the exit status."""

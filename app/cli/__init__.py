"""The verbs of the command line, one module each: `add_parser` is quick to import, `run` imports what the work needs."""

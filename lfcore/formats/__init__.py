"""One module per kind of file; `lfcore.formats.open_light_field` asks each by content."""

"""The library behind lfview: light fields in, views at any (u, v) out. Knows no window, no GL and no imgui."""

"""From the raw mosaic of a Lytro camera to views: calibration, unpacking, shading, grid, colour."""

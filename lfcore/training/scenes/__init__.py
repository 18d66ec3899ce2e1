"""Generated scenes: textures, shapes, surfaces, how they are set up, rendered, and seen through a camera."""

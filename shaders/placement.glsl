// Where the picture lies in the window, by placed.vert. What falls outside it is left out by the scissor.
uniform float scale;  // window pixels per picture pixel

in vec2 picture_point;  // under this fragment, pixel (x, y) covering [x, x + 1) x [y, y + 1)

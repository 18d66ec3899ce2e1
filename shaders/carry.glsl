// The newest disparity map, carried over from the viewpoint for which it was made.
//
// A point at s with disparity D in view q lies at s + (made_at - q) D in the view of the map, so D is a fixed point of
// D = map(s + (made_at - q) D). Where a near thing has moved in front of a far one there are two; the nearer one, which
// is the smaller (u is the camera's own position to the right, so near content moves to the left as it grows), hides
// the other. At the map's own viewpoint the map comes out unchanged.
uniform sampler2D disparity_map;  // sampled at pixels, its edge repeated: a software rasteriser does that faster than a fetch
uniform vec2 made_at;
uniform float nearest_disparity;  // the smallest of the map
uniform int steps;  // as many as things move far

float looked_up(vec2 s) {
    return textureLod(disparity_map, (s + 0.5) / vec2(textureSize(disparity_map, 0)), 0.0).r;
}

// The disparity at pixel s of the view at q.
float carried_disparity(vec2 s, vec2 q) {
    vec2 shift = made_at - q;
    float from_here = looked_up(s);
    float from_near = looked_up(s + shift * nearest_disparity);
    float before = from_near;
    for (int i = 0; i < steps; ++i) {
        before = from_near;
        from_here = looked_up(s + shift * from_here);
        from_near = looked_up(s + shift * from_near);
    }
    bool near_holds = abs(from_near - before) < 0.5;
    return near_holds ? min(from_near, from_here) : from_here;
}

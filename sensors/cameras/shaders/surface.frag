#version 330 core
#ifdef INSTANCED
flat in vec4 lit;
#else
flat in vec4 sun_part;
flat in vec3 sky_part;
in vec2 share;
#endif
uniform vec3 haze_rgb;
uniform float haze_per_m;
layout(location = 0) out vec4 rgb;             // and the material number / 255
layout(location = 1) out uint instance;

void main() {
#ifdef INSTANCED
    vec3 light = lit.rgb;
    uint code = uint(lit.a + 0.5);
    float material = float(code >> 16u) / 255.0;
    instance = code & 65535u;
#else
    vec3 light = sun_part.rgb * share.x + sky_part * share.y;
    float material = sun_part.a;
    instance = 0u;
#endif
    float clear = exp(-haze_per_m / gl_FragCoord.w);   // 1 / w is the depth in metres
    rgb = vec4(sqrt(mix(haze_rgb, light, clear)), material);
}

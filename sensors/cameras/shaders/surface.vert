#version 330 core
// Flat daylight on a face: the last corner's colour and normal light the whole triangle.
layout(location = 0) in vec3 position;
layout(location = 1) in vec3 normal;
layout(location = 2) in vec4 colour;   // square root of albedo; alpha 1 takes the instance's paint
layout(location = 3) in vec4 shade;    // share of sun and of sky; material number / 255; 1 for what glows
#ifdef INSTANCED
layout(location = 4) in vec4 row_x;    // camera-from-model matrix, by rows
layout(location = 5) in vec4 row_y;
layout(location = 6) in vec4 row_z;
layout(location = 7) in vec4 label;    // paint rgb, instance number: the matrix's constant last row put to use
#else
uniform vec3 eye;                      // camera centre in the world, rounded to float
uniform vec3 eye_rest;                 // what the rounding left
uniform mat3 view;                     // camera-from-world rotation
#endif
uniform mat4 clip;                     // clip-from-camera
uniform vec3 sun;                      // towards the sun, camera axes
uniform vec3 up;                       // world's up, camera axes
uniform vec3 sun_rgb;
uniform vec3 sky_rgb;
uniform vec3 ground_rgb;

#ifdef INSTANCED
flat out vec4 lit;                     // light leaving the face; instance number + 65536 × material: one slot is fastest
#else
flat out vec4 sun_part;                // and the material number
flat out vec3 sky_part;
out vec2 share;
#endif

void main() {
#ifdef INSTANCED
    vec4 p = vec4(position, 1.0);
    vec3 v = vec3(dot(row_x, p), dot(row_y, p), dot(row_z, p));
    // inverse transpose of rotation × scale: divide by the squared length of each column
    vec3 unscaled = normal / (row_x.xyz * row_x.xyz + row_y.xyz * row_y.xyz + row_z.xyz * row_z.xyz);
    vec3 n = normalize(vec3(dot(row_x.xyz, unscaled), dot(row_y.xyz, unscaled), dot(row_z.xyz, unscaled)));
    vec3 albedo = mix(colour.rgb * colour.rgb, label.rgb, colour.a);
#else
    vec3 v = view * ((position - eye) - eye_rest);
    vec3 n = view * normal;
    vec3 albedo = colour.rgb * colour.rgb;
#endif
    gl_Position = clip * vec4(v, 1.0);
    n = dot(n, v) > 0.0 ? -n : n;      // faces have two sides, as they have for the LiDAR
    vec3 from_sun = albedo * sun_rgb * max(dot(n, sun), 0.0);
    vec3 from_sky = albedo * mix(ground_rgb, sky_rgb, 0.5 + 0.5 * dot(n, up));
#ifdef INSTANCED
    lit = vec4(mix(from_sun * shade.x + from_sky * shade.y, albedo, shade.w), label.a + 65536.0 * floor(shade.z * 255.0 + 0.5));
#else
    sun_part = vec4(from_sun, shade.z);
    sky_part = from_sky;
    share = shade.xy;
#endif
}

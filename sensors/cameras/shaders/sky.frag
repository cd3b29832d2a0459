#version 330 core
in vec3 direction;
uniform vec3 up;           // world's up, camera axes
uniform vec3 zenith_rgb;
uniform vec3 horizon_rgb;
layout(location = 0) out vec4 rgb;
layout(location = 1) out uint instance;

void main() {
    float height = max(dot(normalize(direction), up), 0.0);
    rgb = vec4(sqrt(mix(horizon_rgb, zenith_rgb, sqrt(height))), 0.0);
    instance = 0u;
}

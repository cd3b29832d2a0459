#version 330 core
// One triangle over the whole image, at infinite distance.
uniform mat3 ray;    // camera direction from clip coordinates
out vec3 direction;

void main() {
    vec2 corner = vec2(gl_VertexID == 1 ? 3.0 : -1.0, gl_VertexID == 2 ? 3.0 : -1.0);
    direction = ray * vec3(corner, 1.0);
    gl_Position = vec4(corner, 0.0, 1.0);
}

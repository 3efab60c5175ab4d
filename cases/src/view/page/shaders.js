// Programs of the graphics card. Positions are in units of the scene: its centre is 0, its radius 1.

/** Larger than any value: no value at this point. */
export const NO_VALUE = 3e38;

const HEAD = `#version 300 es
precision highp float;
precision highp int;
`;

const VERTEX = `
uniform mat4 view;
uniform mat4 projection;
uniform float scale;          // of the displacements
uniform vec2 shift;           // in the picture, for lines of several pixels
uniform float nearer;         // distance by which lines lie in front of their faces
layout(location = 0) in vec3 rest;
layout(location = 1) in vec3 motion;
layout(location = 2) in float value;
layout(location = 3) in uint point;
out float v;
out vec3 eye;
out vec3 computed;
out vec3 drawn;
flat out uint id;
`;

export const CELLS_VERTEX = `${HEAD}${VERTEX}
void main() {
  computed = rest + motion;
  drawn = rest + scale * motion;
  vec4 at = view * vec4(drawn, 1.0);
  eye = at.xyz;
  v = value;
  id = point;
  gl_Position = projection * at;
  vec4 front = projection * (at + vec4(0.0, 0.0, nearer, 0.0));
  gl_Position.z = front.z / front.w * gl_Position.w;
  gl_Position.xy += shift * gl_Position.w;
}`;

export const POINTS_VERTEX = `${HEAD}${VERTEX}
uniform float diameter;       // units of the scene
uniform float pixels;         // height of the picture
uniform vec4 plane;           // points with a positive value are cut away
layout(location = 4) in float size;
out float radius;
void main() {
  computed = rest + motion;
  drawn = rest + scale * motion;
  vec4 at = view * vec4(drawn, 1.0);
  eye = at.xyz;
  v = value;
  id = point;
  radius = 0.5 * diameter * size;
  gl_Position = projection * at;
  gl_PointSize = max(diameter * size * pixels * 0.5 * projection[1][1] / gl_Position.w, 1.5);
  if (dot(plane, vec4(rest, 1.0)) > 0.0) gl_Position = vec4(2.0, 2.0, 2.0, 1.0);
}`;

const COLOUR = `
uniform sampler2D map;
uniform vec2 range;
uniform vec3 plain;           // colour of what has no value
uniform float levels[4];
uniform int level_count;
uniform float ratio;          // pixels for one of the window
in float v;
in vec3 eye;
flat in uint id;
out vec4 colour;
vec3 shade(vec3 base, vec3 normal) {
  float head = abs(normal.z);
  float side = max(dot(normal, normalize(vec3(-0.5, 0.7, 0.6))), 0.0);
  // a little light of its own shows the shape of what is black
  return base * (0.52 + 0.30 * head + 0.24 * side) + 0.035 * head + 0.10 * side * side;
}
vec3 of_value() {
  if (!(abs(v) < 1e38)) return plain;
  float t = (v - range.x) / (range.y - range.x);
  return texture(map, vec2(clamp(t, 0.0, 1.0) * (255.0 / 256.0) + 0.5 / 256.0, 0.5)).rgb;
}
`;

export const CELLS_FRAGMENT = `${HEAD}${COLOUR}
void main() {
  vec3 normal = normalize(cross(dFdx(eye), dFdy(eye)));
  if (normal.z < 0.0) normal = -normal;
  vec3 base = of_value();
  float slope = fwidth(v);
  for (int i = 0; i < 4; i++) {
    if (i >= level_count || !(abs(v) < 1e38) || slope == 0.0) break;
    float distance = abs(v - levels[i]) / slope;
    base = mix(i == 0 ? vec3(1.0) : vec3(0.43, 0.88, 1.0), base, smoothstep(0.7 * ratio, 0.7 * ratio + 0.8, distance));
  }
  colour = vec4(shade(base, normal), 1.0);
}`;

export const POINTS_FRAGMENT = `${HEAD}${COLOUR}
in float radius;
void main() {
  vec2 at = 2.0 * gl_PointCoord - 1.0;
  float r2 = dot(at, at);
  if (r2 > 1.0) discard;
  vec3 normal = vec3(at.x, -at.y, sqrt(1.0 - r2));
  colour = vec4(shade(of_value(), normal), 1.0);
}`;

export const LINES_FRAGMENT = `${HEAD}
uniform vec3 ink;
out vec4 colour;
void main() { colour = vec4(ink, 0.65); }`;

// for the point under the cursor: its number and that of its body, and its place, as colours
const PICK = `
uniform uint body;
in float v;
in vec3 eye;
in vec3 computed;
in vec3 drawn;
flat in uint id;
layout(location = 0) out uvec4 colour;
layout(location = 1) out uvec4 as_computed;
layout(location = 2) out uvec4 as_drawn;
void write() {
  colour = uvec4(id, body, 0u, 1u);
  as_computed = uvec4(floatBitsToUint(computed), 1u);
  as_drawn = uvec4(floatBitsToUint(drawn), 1u);
}
`;
export const CELLS_PICK = `${HEAD}${PICK}
void main() { write(); }`;
export const POINTS_PICK = `${HEAD}${PICK}
in float radius;
void main() {
  vec2 at = 2.0 * gl_PointCoord - 1.0;
  if (dot(at, at) > 1.0) discard;
  write();
}`;

#version 460
#extension GL_GOOGLE_include_directive : require
// Asks for one coordinate a thread; tests/sampler.rs compiles it.
layout(local_size_x = 64) in;

struct Question { uint x; uint y; uint index; uint dimension; };
layout(set = 0, binding = 0, std430) readonly buffer Questions { Question data[]; } questions;
layout(set = 0, binding = 1, std430) writeonly buffer Answers { uint data[]; } answers;
layout(set = 0, binding = 2, std430) readonly buffer SamplerTable { uint data[]; } sampler_table;
#include "sampler.glsl"

void main() {
    uint i = gl_GlobalInvocationID.x;
    if (i < uint(questions.data.length())) {
        Question q = questions.data[i];
        answers.data[i] = sampler_pair(uvec2(q.x, q.y), q.index, q.dimension / 2u)[q.dimension & 1u];
    }
}

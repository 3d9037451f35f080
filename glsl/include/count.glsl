// What rays cost, counted (paper 2, section 5): nodes that they visit and triangles that they test, and how much of either the
// rays of a packet have in common. A packet is 16 threads that follow each other, as a packet of paper 2 is 16 rays (section 3.1).
//
// With COUNT defined an entry shader of 64 threads binds, before it includes this file,
//   buffer .. { Traversals data; } traversals;
// calls begin_count() with all threads of a workgroup before the first of them traces, and end_count() with all of them after the last;
// traverse() counts in between. A thread's rays are all of one kind. Without COUNT nothing is there, not even a variable.
// Twin: src/oracle/count.rs.

#ifndef STILLRAY_COUNT
#define STILLRAY_COUNT

#ifdef COUNT
#include "random.glsl"

const uint PACKETS = 64u / PACKET_THREADS;
// Bits of a set of triangles: how many have been put into it is told from how many are set (linear counting: Whang, Vander-Zanden and
// Taylor 1990), with a standard deviation of 2 % where there are no more than as many.
const uint PACKET_BITS = 2048u;
const uint PACKET_WORDS = PACKET_BITS / 32u;

// Of this thread.
uint rays_traced = 0u;
uint nodes_visited = 0u;
uint triangles_tested = 0u;
uint steps_marched = 0u;

// Of each kind: rays, nodes, triangles, nodes that threads had time for, packets, triangles of packets.
shared uint count_sums[6u * RAY_KINDS];
shared uint step_sum;
// Of each packet: the nodes of its slowest thread, with that thread's kind in the three lowest bits, and 1; 0 if it has no ray.
shared uint packet_slowest[PACKETS];
shared uint packet_seen[PACKETS * PACKET_WORDS];
shared uint packet_filled[PACKETS];

uint packet_of_thread() {
    return gl_LocalInvocationIndex / PACKET_THREADS;
}

void begin_count() {
    uint thread = gl_LocalInvocationIndex;
    if (thread < 6u * RAY_KINDS) {
        count_sums[thread] = 0u;
    }
    if (thread == 0u) {
        step_sum = 0u;
    }
    if (thread < PACKETS) {
        packet_slowest[thread] = 0u;
        packet_filled[thread] = 0u;
    }
    packet_seen[thread] = 0u;
    packet_seen[thread + 64u] = 0u;
    packet_seen[thread + 128u] = 0u;
    packet_seen[thread + 192u] = 0u;
    barrier();
}

void count_ray() {
    ++rays_traced;
}

void count_step() {
    ++steps_marched;
}

void count_node() {
    ++nodes_visited;
}

// The n-th rays of a packet's threads have their triangles in common, and not with others.
void count_triangle(uint instance, uint primitive) {
    ++triangles_tested;
    uint bit = hash_combine(hash_combine(rays_traced, instance), primitive) % PACKET_BITS;
    atomicOr(packet_seen[packet_of_thread() * PACKET_WORDS + bit / 32u], 1u << (bit % 32u));
}

// How many different things were put into a set of which so many bits are set.
uint set_size(uint filled) {
    float empty = float(PACKET_BITS - min(filled, PACKET_BITS - 1u)) / float(PACKET_BITS);
    return uint(-float(PACKET_BITS) * log(empty) + 0.5);
}

void count_packet(uint packet) {
    uint slowest = packet_slowest[packet];
    if (slowest != 0u) {
        uint first = 6u * ((slowest - 1u) & 7u);
        atomicAdd(count_sums[first + 3u], PACKET_THREADS * ((slowest - 1u) >> 3u));
        atomicAdd(count_sums[first + 4u], 1u);
        atomicAdd(count_sums[first + 5u], set_size(packet_filled[packet]));
    }
}

// 64 bits, in two words.
#define ADD(counter, amount) \
    { \
        uint before = atomicAdd(counter[0], amount); \
        if (before + amount < before) atomicAdd(counter[1], 1u); \
    }

void add_counts(uint kind) {
    uint first = 6u * kind;
    ADD(traversals.data.kinds[kind].rays, count_sums[first]);
    ADD(traversals.data.kinds[kind].nodes, count_sums[first + 1u]);
    ADD(traversals.data.kinds[kind].triangles, count_sums[first + 2u]);
    ADD(traversals.data.kinds[kind].held, count_sums[first + 3u]);
    ADD(traversals.data.kinds[kind].packets, count_sums[first + 4u]);
    ADD(traversals.data.kinds[kind].packet_triangles, count_sums[first + 5u]);
}

// The thread's rays were of this kind.
void end_count(uint kind) {
    uint thread = gl_LocalInvocationIndex;
    uint packet = packet_of_thread();
    if (rays_traced != 0u) {
        atomicAdd(count_sums[6u * kind], rays_traced);
        atomicAdd(count_sums[6u * kind + 1u], nodes_visited);
        atomicAdd(count_sums[6u * kind + 2u], triangles_tested);
        atomicMax(packet_slowest[packet], (nodes_visited << 3u | kind) + 1u);
    }
    atomicAdd(step_sum, steps_marched);
    barrier();
    uint word = packet * PACKET_WORDS + thread % PACKET_THREADS;
    uint filled = bitCount(packet_seen[word]) + bitCount(packet_seen[word + 16u]) + bitCount(packet_seen[word + 32u])
        + bitCount(packet_seen[word + 48u]);
    atomicAdd(packet_filled[packet], filled);
    barrier();
    if (thread % PACKET_THREADS == 0u) {
        count_packet(packet);
    }
    barrier();
    if (thread < RAY_KINDS && count_sums[6u * thread] + count_sums[6u * thread + 4u] != 0u) {
        add_counts(thread);
    }
    if (thread == 63u && step_sum != 0u) {
        ADD(traversals.data.march_steps, step_sum);
    }
}

#else

void begin_count() {}
void count_ray() {}
void count_node() {}
void count_step() {}
void count_triangle(uint instance, uint primitive) {}
void end_count(uint kind) {}

#endif

#endif

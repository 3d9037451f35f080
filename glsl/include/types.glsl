// Structs that Rust and GLSL share. build.rs reflects them and emits their Rust twins (crate::shaders): they are
// declared here and nowhere else. Comments after members give unit and range.

#ifndef STILLRAY_TYPES
#define STILLRAY_TYPES

const uint INFINITY_BITS = 0x7f800000u;  // of a float
const float SMALLEST_NORMAL = 1.1754944e-38;

// What a frame may need modelled: which variant of each shader runs. A scene that needs nothing pays for nothing.
const uint MODEL_AGE = 1u;     // samples know how many frames they have lived
const uint MODEL_SOURCE = 2u;  // samples know which sample of the last frame they were
const uint MODEL_SEED = 4u;    // samples have coordinates beyond the picture: on the lens, on lights
const uint MODEL_ALPHA = 8u;   // surfaces have holes
const uint MODEL_LENS = 16u;   // the camera has an aperture
const uint MODEL_AREA = 32u;   // some light has an extent
const uint MODEL_ENVIRONMENT = 64u;  // light comes from all around as a map says
const uint MODEL_DEFORM = 128u;  // some mesh deforms
const uint MODEL_MOTION = 256u;  // the camera's shutter is open for a while
// MODEL_MOTION brings LENS DEFORM SEED
const uint MODEL_EMITTER = 8192u;  // triangles that shine are sampled as lights
// MODEL_EMITTER brings LENS AREA ENVIRONMENT DEFORM SEED
const uint MODEL_PATH = 1024u;  // paths go on behind what the camera sees: reflections, refraction
// MODEL_PATH brings SEED AREA ENVIRONMENT
const uint MODEL_INDIRECT = 2048u;  // samples gather what diffuse paths bring
// MODEL_INDIRECT brings PATH SEED AREA ENVIRONMENT
const uint MODEL_MEDIUM = 512u;  // there is fog or mist
// MODEL_MEDIUM brings LENS AREA DEFORM ENVIRONMENT SEED
const uint MODEL_COUNT = 16384u;  // what rays cost is counted
// With everything else, so that each kernel that traces has one variant more and not twice as many.
// MODEL_COUNT brings ALPHA LENS AREA ENVIRONMENT DEFORM PATH MEDIUM SEED MOTION EMITTER

// A cached sample: 16 bytes (paper 1, section 5).
struct Sample {
    // Object space, metres; on an instance that deforms (triangle slot in the mesh, weight of vertex 1, weight of vertex 2); for
    // SKY_INSTANCE a unit direction in world space; for NEW_INSTANCE (x, y, 0) in pixels.
    vec3 position;
    uint instance;  // bit 31: occluded in the frame that wrote it; bits 0..30: instance, or one of the two marks below
};

const uint OCCLUDED_BIT = 0x80000000u;
const uint INSTANCE_MASK = 0x7fffffffu;
const uint SKY_INSTANCE = 0x7fffffffu;  // the ray hit nothing
const uint NEW_INSTANCE = 0x7ffffffeu;  // not traced yet; after verification: lost, to be forgotten

// What a camera ray found for a sample of the cache.
struct Found {
    uint instance;   // instance hit, or SKY_INSTANCE; bit 31: a cached sample is hidden by what was hit
    uint primitive;  // global triangle slot; FOUND_LOST: a cached sample that its ray no longer finds
    float u;         // barycentric weight of vertex 1
    float v;         // barycentric weight of vertex 2
};

const uint FOUND_LOST = 0xfffffffdu;

const uint NO_SOURCE = 0xffffffffu;  // of a sample that no sample of the last frame was before

// What a ray found.
struct Hit {
    uint primitive;  // global triangle slot in leaf order, or one of the marks below
    float u;         // barycentric weight of vertex 1
    float v;         // barycentric weight of vertex 2
    float t;         // distance from the camera in metres; infinity for the sky
};

const uint HIT_SKY = 0xffffffffu;       // nothing hit

// A shaded sample: 16 bytes.
struct Shaded {
    uint color_rg;        // two halves: scene-linear red and green
    uint color_b_offset;  // low half: blue; high half: two bytes, subpixel position x and y in 1/256 of a pixel
    uint motion;          // two halves: pixels moved since the last frame; or MOTION_UNKNOWN
    float depth;          // distance from the camera in metres; infinity for the sky; negative: no sample
};

const uint MOTION_UNKNOWN = 0x7c007c00u;  // a sample that was behind the camera, or far outside the frame

// Attributes of a vertex: 32 bytes.
struct Vertex {
    uint normal;    // octahedral, 2 x 16-bit snorm
    uint tangent;   // octahedral, 16-bit snorm x and 15-bit snorm y; bit 31: handedness is negative
    vec2 uv0;
    vec2 uv1;
    uint color_rg;  // 2 x 16-bit unorm, linear
    uint color_ba;  // 2 x 16-bit unorm, linear
};

// An instance in a frame. Rows of 3x4 matrices.
struct Instance {
    vec4 to_relative[3];  // object to camera-relative world space (world axes, camera at the origin), metres
    vec4 to_object[3];    // its inverse
    vec4 previous[3];     // object to the last frame's camera-relative space
    uint node_base;       // first BLAS node in `nodes`
    uint triangle_base;   // first triangle slot of the mesh
    uint flags;           // INSTANCE_* below
    uint leaf;            // of slot i: the instance that the TLAS's i-th leaf refers to
};

const uint INSTANCE_FLIPPED = 1u;  // the transform's determinant is negative
const uint INSTANCE_ALPHA = 2u;    // some material of the mesh has an alpha mask or blend, or lets light through
const uint INSTANCE_DEFORMS = 4u;  // the mesh is another one in each frame
const uint INSTANCE_MOVES = 8u;    // it is elsewhere at other times of the frame: between `previous` and `to_relative`
const uint INSTANCE_SHAPE_SHIFT = 4u;  // of an instance that deforms, the bits from here on: its first triangle in `previous_corners`
const uint SHAPE_TRIANGLES = 16777216u;  // that a mesh which deforms may have: slots are told as floats

const uint TRAVERSAL_STACK = 32u;        // entries of a ray's stack; accel/ refuses or rebuilds what would need more
const uint TRAVERSAL_STEPS = 1048576u;   // nodes that a ray visits at most: an end, whatever the data

// A triangle slot's vertices and material.
struct Triangle {
    uint vertex0;  // global vertex index
    uint vertex1;
    uint vertex2;
    uint material;
};

// One texture slot of a material.
struct TextureSlot {
    vec4 transform;  // rows: u' = x*u + y*v + offset.x, v' = z*u + w*v + offset.y
    vec2 offset;
    uint texel_origin;  // x | y << 16 in the atlas page
    uint texel_size;    // width | height << 16; 0: no texture
    uint page;          // layer of the atlas
    uint flags;         // bits 0..1: wrap u, bits 2..3: wrap v (0 repeat, 1 mirror, 2 clamp), bit 4: nearest, bit 5: second uv set
    uint padding0;
    uint padding1;
};

struct Material {
    vec4 base_color;
    vec3 emissive;
    float metallic;
    float roughness;
    float normal_scale;
    float occlusion_strength;
    float alpha_cutoff;
    uint flags;  // MATERIAL_* below
    float dielectric;  // 0..1: reflectance at normal incidence where it is not metal
    float index;       // of refraction; 0: reflects everything
    float exponent;    // of Phong's lobe, which takes the place of the roughness's; 0: none
    vec3 absorption;   // of what is inside, 1/metre
    float transmission;  // 0..1: part of what enters it that passes through
    TextureSlot base_color_texture;
    TextureSlot metallic_roughness_texture;
    TextureSlot normal_texture;
    TextureSlot occlusion_texture;
    TextureSlot emissive_texture;
    TextureSlot transmission_texture;
};

const uint MATERIAL_MASK = 1u;
const uint MATERIAL_BLEND = 2u;
const uint MATERIAL_DOUBLE_SIDED = 4u;
const uint MATERIAL_UNLIT = 8u;
const uint MATERIAL_TRANSMITS = 16u;
const uint MATERIAL_SOLID = 32u;  // what transmits is a body that refracts, and not a thin wall

// A punctual light in a frame.
struct Light {
    vec3 position;      // camera-relative, metres
    uint kind;          // LIGHT_POINT, LIGHT_SPOT or LIGHT_DIRECTIONAL
    vec3 direction;     // unit vector along which it shines
    float inv_range2;   // 1 / range^2; 0: no range
    vec3 intensity;     // colour times candela or lux
    float spot_scale;   // 1 / (cos inner - cos outer), guarded
    vec3 right;         // half its extent across: metres; of a directional light the tangent of its angular radius
    float spot_offset;  // -cos outer * spot_scale
    vec3 up;            // the same along its other axis
    uint shape;         // LIGHT_SHARP, LIGHT_RECTANGLE, LIGHT_DISC or LIGHT_MESH
    vec3 moved;         // metres that the position moved relative to the camera since the last frame
    uint padding0;
};

const uint LIGHT_SHARP = 0u;  // no extent
const uint LIGHT_RECTANGLE = 1u;
const uint LIGHT_DISC = 2u;
const uint LIGHT_MESH = 3u;  // all triangles that shine: emitter.glsl

const uint LIGHT_POINT = 0u;
const uint LIGHT_SPOT = 1u;
const uint LIGHT_DIRECTIONAL = 2u;

// The map of light from all around, in words: a header of six (width, height, turn as the bits of a float, first word of the
// blurred map; a width of 0: there is none; first word and number of the triangles that shine), four for each row and for the end (sin^2 and cos^2 of half the angle from the zenith
// to its upper edge, solid angle of each of its texels in steradians, as the bits of floats; chance of the rows above,
// ENVIRONMENT_ONE to one), for each row a word a texel and for the end (chance of the texels to its left), and three floats a
// texel; then the same map, small and blurred, three floats a texel. Whether there is a map or not, triangles that shine follow, five
// words each: instance and EMITTER_TWO_SIDED, triangle slot, chance that a draw stays with it (2^32 to one), the row that it goes to
// otherwise, and one over the chance with which it is drawn, as the bits of a float.
const uint ENVIRONMENT_HEADER = 6u;
const uint EMITTER_TABLE = 4u;  // where the header tells of them
const uint EMITTER_COUNT = 5u;
const uint EMITTER_WORDS = 5u;
const uint EMITTER_TWO_SIDED = 0x80000000u;
const uint ENVIRONMENT_ROW = 4u;
const uint ENVIRONMENT_BLURRED_WIDTH = 32u;
const uint ENVIRONMENT_BLURRED_HEIGHT = 16u;
const uint ENVIRONMENT_ONE = 0x80000000u;
const uint ENVIRONMENT_LIGHT = 31u;  // bit of `lit` that stands for it, where there is one

// The point of the last frame that a pixel's ray goes towards, of those that are projected onto the pixel. All bits are set
// where there is none, so that one fill clears it.
struct Tracked {
    uint nearest;  // least squared distance from the camera, the bits of a float in square metres
    uint point;    // the first point at that distance, as its index in the last frame's list
    uint others;   // points besides it
};

// Counts of a frame, and the arguments of its indirect dispatches.
struct Counters {
    uint trace_x;     // workgroups over the dense list of samples, for vkCmdDispatchIndirect
    uint trace_y;
    uint trace_z;
    uint samples;     // length of the dense list
    uint thin;        // 2^32 times the part of the samples that fits the cache, 0 if all do
    uint first;       // samples of the dense list before those that were listed last: 0, or where the fill begins
    uint fill_x;      // workgroups over the samples that the fill adds, for vkCmdDispatchIndirect
    uint fill_y;
    uint fill_z;
    uint reused;      // samples that were reprojected and kept
    uint added;
    uint evicted;     // by the analysis
    uint occluded;    // kept samples found hidden
    uint lost;        // kept samples that their ray did not find
    uint replaced;    // occluded samples that took their occluder's hit
    uint shadow_rays;
    uint histogram[17];  // pixels with 0, 1, ... 16 reprojected unoccluded samples
    uint reflection_rays;
    uint refraction_rays;
    uint indirect_rays;
};

// The secondary rays of one step of all paths: those that are reflected are listed from the front of a list, those that are refracted from
// its back, so that rays of a kind are traced together (paper 2, section 3). See FRAME_PATHS_MIXED and FRAME_PATHS_SPREAD.
struct PathCounters {
    uint trace_x;  // workgroups over the list, for vkCmdDispatchIndirect
    uint trace_y;
    uint trace_z;
    uint reflected;
    uint refracted;
    uint listed;   // entries of the list
    uint padding0;
    uint padding1;
};

const uint PATH_STEPS = 8u;  // of a path at most
const uint NO_PATH = 0xffffffffu;  // in the list of a step: a sample that has no ray in it

// Kinds of rays, where they are counted.
const uint RAY_CAMERA = 0u;
const uint RAY_SHADOW = 1u;     // from surfaces
const uint RAY_REFLECTED = 2u;
const uint RAY_REFRACTED = 3u;
const uint RAY_MARCH = 4u;      // from points of a march through a medium, to a light
const uint RAY_INDIRECT = 5u;   // of diffuse paths
const uint RAY_KINDS = 6u;

const uint PACKET_THREADS = 16u;  // threads of a packet, where rays are counted

// What a ray of a path carries beside its origin: the number of a diffuse path among those of its sample, the ray's kind, and
// whether a diffuse path was reflected since a surface scattered it.
const uint PATH_NUMBER = 0x0fffffffu;
const uint PATH_KIND = 28u;  // shift
const uint PATH_KINDS = 7u;
const uint PATH_MIRRORED = 0x80000000u;

// What the rays of one kind have cost in a frame. Each count is 64 bits: its low word, then its high one.
struct RayCosts {
    uint rays[2];
    uint nodes[2];             // visited
    uint triangles[2];         // tested
    uint held[2];              // nodes that the threads of their packets had time for: in each packet 16 times those of the slowest
    uint packets[2];           // by the kind of their slowest ray
    uint packet_triangles[2];  // different ones that the rays of a packet tested, summed over packets
};

struct Traversals {
    RayCosts kinds[6];  // RAY_KINDS
    uint march_steps[2];
};

// Constants of a frame.
struct Frame {
    vec4 right;            // xyz: camera axis in world space; w: tan(yfov/2) * width / height
    vec4 up;               // xyz; w: tan(yfov/2)
    vec4 forward;          // xyz; w: angle of a pixel at the centre, radians
    vec4 previous_right;   // as above, in the last frame
    vec4 previous_up;
    vec4 previous_forward;
    vec4 environment;      // rgb radiance; w: unused
    vec4 lens;             // x: radius of the aperture, metres; y: 1 / focus distance in metres; z: blades, 0: a disc; w: turn of the blades, 0..1
    vec4 previous_lens;
    uvec2 size;            // pixels
    uint frame;            // counts from the last reset
    uint seed;
    float d_target;        // samples a pixel
    float d_tolerance;     // samples a pixel
    uint light_count;
    uint instance_count;
    uint flags;            // FRAME_* below
    uint capacity;         // samples that a cache holds
    uint occluded_limit;   // occluded samples kept a pixel
    uint alpha_seed;       // varies the hashed alpha threshold; constant where samples are kept
    uint spp;              // methods that keep no samples: samples a pixel
    uint jitter;           // methods that keep no samples: varies the sample positions
    uint shadow_rays;      // a sample and frame at most; 0: every light reaches
    float filter_width;    // standard deviation of the reconstruction filter, pixels
    uint variation;        // of the coordinates of samples on lens and lights: 0 where they belong to the sample
    float gloss;           // surfaces of at most this roughness send reflection rays; 0: none do
    float part;            // of the paths at a surface that both reflects and transmits, those that are reflected
    uint path_depth;       // secondary rays of a path at most
    uint indirect;         // rays of a diffuse path; 0: there are none
    float indirect_alpha;  // least weight of the newest path in its sample's mean while something moves
    uint indirect_count;   // paths that a mean counts for at most while something moves
    float indirect_clamp;  // radiance that a path brings at most; 0: no limit
    float shutter;         // part of the time from the last frame to this one for which the shutter is open, at its end: 0..1
    uint emitters;         // points of what shines that are drawn a sample, of which one gets a shadow ray; 0: it is no light
    uint padding0;
    uint padding1;
};

const uint FRAME_RESET = 1u;    // the cache is empty: a camera cut
const uint FRAME_SETTLED = 2u;  // nothing has moved for two frames: keep the sampling pattern as it is
const uint FRAME_PAPER_EDGES = 4u;  // Equation 1 decides everywhere, beside hidden samples too
const uint FRAME_NEAREST = 8u;  // textures are not filtered
const uint FRAME_QUARTERS = 16u;  // a subpixel is a quarter of a pixel (M = 2), not a sixteenth (M = 4)
const uint FRAME_LIT_ALIKE = 1024u;  // nothing has moved for long that light falls on or comes from
const uint FRAME_PATHS_MIXED = 256u;  // secondary rays are listed in the order of samples, whatever their kind
const uint FRAME_PATHS_SPREAD = 512u;  // every sample has a thread in every step of paths, whether it has a ray or not
const uint FRAME_TURNS = 64u;  // the camera's axes move while the shutter is open
const uint FRAME_FILL = 32u;  // pixels have a second run of samples, which a fill has added behind the list

// A participating medium in a frame: see scene/medium.rs.
struct Medium {
    vec3 scattering;    // 1/metre where the density is 1
    float anisotropy;   // Henyey and Greenstein's g, above -1 and below 1
    vec3 absorption;    // 1/metre
    uint kind;          // MEDIUM_NONE, MEDIUM_FOG or MEDIUM_MIST
    vec3 ambient;       // radiance from all around, evenly
    uint steps;         // of a march
    vec3 centre;        // of the box, camera-relative, metres
    float amplitude;    // of the noise, metres
    vec3 half_extent;   // of the box, metres
    float per_period;   // periods of the noise a metre
    vec3 noise_origin;  // where in its period the noise is at the camera, 0..1
    uint padding0;
};

// What the diffuse paths of a sample have brought: 16 bytes.
struct Gathered {
    vec3 radiance;  // mean of them: irradiance over pi
    uint paths;     // bits 0..15: how many the mean counts for; bits 16..31: how many there were, in turns of 2^16
};

const uint MEDIUM_NONE = 0u;
const uint MEDIUM_FOG = 1u;
const uint MEDIUM_MIST = 2u;
const uint MEDIUM_NOISE_SIDE = 32u;  // cells of the noise along each side

// Layout of a sampler's table, in words (see sampler.glsl).
const uint SAMPLER_KIND = 0u;         // SAMPLER_PATTERNS, SAMPLER_SEQUENCE or SAMPLER_RANDOM
const uint SAMPLER_DIGITS = 1u;       // bits of a coordinate that a pattern decides
const uint SAMPLER_LOG_COUNT = 2u;    // log2 of the samples a pixel, rounded up
const uint SAMPLER_SEED = 3u;
const uint SAMPLER_TILE = 4u;         // 16 x 16 pixels' patterns, four a word
const uint SAMPLER_DIRECTIONS = 68u;  // 16 dimensions x 32 direction numbers
const uint SAMPLER_POINTS = 580u;     // 8 pairs x 16 patterns x 16 samples x 2 coordinates
const uint SAMPLER_PATTERNS = 0u;
const uint SAMPLER_SEQUENCE = 1u;
const uint SAMPLER_RANDOM = 2u;

#endif

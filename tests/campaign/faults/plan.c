#include "plan.h"

#include <inttypes.h>
#include <stdio.h>
#include <string.h>

#include "base/elementary.h"

enum { SCENES = 6, RIGS = 5, WORLDS = 4, REAL = 2, STEREO = 1u << 0, IMU = 1u << 1, WHEELS = 4 };

static const char *const scenes[SCENES] = {"orbit", "corridor", "wander", "stopgo", "fast", "tour"};
static const char *const real[REAL] = {"handheld", "euroc"};

static const char *const names[] = {
#define FV_FAULT(name, needs_last) #name,
#define FV_FAULT_OTHER(name) #name,
#include "drivers/fault/faults.def"
};

const char *faults_kind_name(uint32_t kind)
{
    if (kind == FAULTS_KIND_MIXED) return "mixed";
    if (kind == FAULTS_KIND_HOLD) return names[FV_FAULT_hold];
    return kind < FAULTS_KIND_MIXED ? names[kind] : "none";
}

/* Rig r: bits STEREO and IMU, or wheel odometry beside one camera. */
static void simulated(uint32_t scene, uint32_t rig, uint32_t world, char *uri, size_t bytes)
{
    (void)snprintf(uri, bytes, "sim:%s?width=%d&height=%d&frames=%d&seed=%u&rate=%d&time=%u%s%s",
                   scenes[scene], FAULTS_WIDTH, FAULTS_HEIGHT, FAULTS_FRAMES, world,
                   world % 2 ? 30 : 20, 3 * world,
                   rig < WHEELS && rig & STEREO ? "&baseline=0.11" : "",
                   rig < WHEELS && rig & IMU ? "&imu=200" : "");
}

bool faults_recording(uint32_t number, char name[64], char uri[256])
{
    if (number >= RIGS) return false;
    (void)snprintf(name, 64, "recorded-%u.log", number);
    simulated(number, number, 5 + number, uri, 256);
    return true;
}

static double between(struct fv_random *random, double low, double high)
{
    return low + (high - low) * fv_random_unit(random);
}

/* How strong a fault of a kind is: from hardly to be seen up to hopeless. */
static void strength(struct fv_random *random, uint32_t kind, char *text, size_t bytes)
{
    const double u = fv_random_unit(random), v = fv_random_unit(random);
    text[0] = '\0';
    switch (kind) {
    case FV_FAULT_black:
        (void)snprintf(text, bytes, "&level=%d", (int)(60 * u));
        break;
    case FV_FAULT_occlusion:
        (void)snprintf(text, bytes, "&share=%.3f", 0.1 + 0.8 * u);
        break;
    case FV_FAULT_zoom:
        (void)snprintf(text, bytes, "&factor=%.4f", 0.96 + 0.08 * u);
        break;
    case FV_FAULT_blur:
        (void)snprintf(text, bytes, "&sigma=%.2f", 0.5 + 10 * u);
        break;
    case FV_FAULT_motion:
        (void)snprintf(text, bytes, "&length=%d", 4 + (int)(80 * u));
        break;
    case FV_FAULT_exposure:
        (void)snprintf(text, bytes, "&gain=%.3f", v < 0.5 ? 0.1 + 0.8 * u : 1.2 + 4 * u);
        break;
    case FV_FAULT_noise:
        (void)snprintf(text, bytes, "&amount=%.1f", 3 + 60 * u);
        break;
    case FV_FAULT_recompress:
        (void)snprintf(text, bytes, "&quality=%d", 2 + (int)(60 * u));
        break;
    case FV_FAULT_jitter:
        (void)snprintf(text, bytes, "&spread=%.3f", 0.2 + 40 * u);
        break;
    case FV_FAULT_jump:
    case FV_FAULT_imu_jump:
        (void)snprintf(text, bytes, "&leap=%.1f", (v < 0.5 ? -1 : 1) * (5 + 895 * u));
        break;
    case FV_FAULT_imu_drop:
    case FV_FAULT_imu_repeat:
    case FV_FAULT_imu_swap:
    case FV_FAULT_imu_nan:
        (void)snprintf(text, bytes, "&chance=%.3f", 0.01 + 0.6 * u);
        break;
    case FV_FAULT_imu_bias:
        (void)snprintf(text, bytes, "&gyro=%.4f&acceleration=%.3f", 0.2 * u, 2 * v);
        break;
    case FV_FAULT_imu_saturate:
        (void)snprintf(text, bytes, "&gyro_end=%.3f&acceleration_end=%.3f", 0.1 + 2 * u,
                       4 + 15 * v);
        break;
    default:
        break;
    }
}

/* The options of a fault. `cameras` of the rig: a fault of pictures, and unplugging, may strike one
 * of two. */
static void draw_fault(struct fv_random *random, uint32_t kind, uint32_t cameras, char text[256])
{
    char strong[96], camera[32] = "";
    const uint32_t seed = fv_random_u32(random), first = 5 + fv_random_below(random, 56),
                   shortest = 1 + fv_random_below(random, 15),
                   longest = shortest + fv_random_below(random, 26),
                   struck = fv_random_below(random, 4); /* half of all times: all cameras */
    const double fraction = between(random, 0.05, 0.5);
    strength(random, kind, strong, sizeof strong);
    if ((kind < FV_FAULT_OF_FRAMES || kind == FV_FAULT_unplug) && cameras > 1 && struck > 1)
        (void)snprintf(camera, sizeof camera, "&camera=%u", struck - 1);
    (void)snprintf(text, 256, "kind=%s&seed=%u&first=%u&shortest=%u&longest=%u&fraction=%.3f%s%s",
                   names[kind], seed, first, shortest, longest, fraction, strong, camera);
}

/* The source; returns bits STEREO and IMU of its rig. */
static uint32_t draw_source(struct fv_random *random, const char *folder, bool needs_imu,
                            struct faults_plan *plan)
{
    const uint32_t scene = fv_random_below(random, SCENES), any = fv_random_below(random, RIGS),
                   with_imu = IMU | (any & STEREO), world = 1 + fv_random_below(random, WORLDS);
    uint32_t rig = needs_imu && (any >= WHEELS || !(any & IMU)) ? with_imu : any;
    plan->wheels = rig >= WHEELS;
    if (plan->origin == FAULTS_SIMULATED) {
        simulated(scene, rig, world, plan->source, sizeof plan->source);
    } else if (plan->origin == FAULTS_RECORDED) {
        char name[64];
        (void)faults_recording(rig, name, plan->twin);
        (void)snprintf(plan->source, sizeof plan->source, "lcmlog:%s/%s", folder, name);
    } else {
        plan->wheels = false;
        rig = 0;
        (void)snprintf(plan->source, sizeof plan->source, "tum:%s/%s", folder, real[scene % REAL]);
    }
    return rig < WHEELS ? rig : 0;
}

static bool of_imu(uint32_t kind)
{
    return kind >= FV_FAULT_OF_SAMPLES && kind < FV_FAULT_OF_CALLS;
}

/* Of twenty rounds the last ten have stamps that stand still in place of two kinds at once. */
enum { TURNS = FAULTS_KIND_MIXED + 1, ROUNDS = 10 };

static uint32_t kind_of(uint64_t seed)
{
    const uint32_t turn = (uint32_t)(seed % TURNS);
    const bool later = seed / TURNS / ROUNDS % 2 == 1;
    return turn == FAULTS_KIND_MIXED && later ? FAULTS_KIND_HOLD : turn;
}

void faults_plan_draw(uint64_t seed, const char *folder, struct faults_plan *plan)
{
    const uint64_t round = seed / TURNS % ROUNDS;
    struct fv_random random;
    memset(plan, 0, sizeof *plan);
    plan->seed = seed;
    plan->kind = kind_of(seed);
    const bool two = plan->kind == FAULTS_KIND_MIXED;
    plan->count = two ? 2 : 1;
    fv_random_seed(&random, seed);
    uint32_t kinds[2] = {plan->kind == FAULTS_KIND_HOLD ? FV_FAULT_hold : plan->kind, 0};
    if (two) {
        kinds[0] = fv_random_below(&random, FV_FAULT_OF_CALLS);
        kinds[1] = fv_random_below(&random, FV_FAULT_OF_CALLS);
    }
    const bool needs_imu = of_imu(kinds[0]) || (two && of_imu(kinds[1]));
    plan->origin = round < 6                ? FAULTS_SIMULATED
                   : round < 9 || needs_imu ? FAULTS_RECORDED
                                            : FAULTS_REAL;
    const uint32_t rig = draw_source(&random, folder, needs_imu, plan);
    for (int i = 0; i < (two ? 2 : 1); i++)
        draw_fault(&random, kinds[i], rig & STEREO ? 2 : 1, plan->options[i]);
    (void)snprintf(plan->uri, sizeof plan->uri, "fault:%s%s?%s%s%s", two ? "fault:" : "",
                   plan->source, plan->options[0], two ? "?" : "", two ? plan->options[1] : "");
}

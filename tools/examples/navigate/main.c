/* Drive a robot to a goal through what it has not seen: the grid of free space and the pose come in
 * by LCM, velocity commands go out.
 *
 *     navigate X Y [--url URL] [--prefix FOVEA] [--radius 0.2] [--speed 0.5] [--turning 1.2]
 *         [--patience 2] [--key FILE [--run-id N] [--sender 1]]
 *
 * X, Y: the goal in metres in the frame odom, which is where the body was at the start: ahead, and
 * to the left. Start it before the run, or within 20 s of it, for example
 *
 *     build/examples/navigate 8 -1.5 &
 *     fovea run --source 'sim:drive?commands=1&baseline=0.12' --model src/detect/segmenter.fvm \
 *         --set grid.enabled=true --set 'T_body_cam=[...]'
 *
 * Every pose is answered, so that sim:drive goes on in lock-step. Without a pose in metres, and
 * when nothing comes for so many seconds as --patience says, the robot is asked to stand, as it is
 * at SIGINT and SIGTERM, which end the program. Exit 0: at the goal. The planner begins in plan.h.
 *
 * A run with command_key takes only what was signed with its key: --key names the file. The number
 * of the run that is meant is heard on PREFIX_RUN, or given by --run-id; each program that shares
 * the key needs a --sender of its own. */
#include <errno.h>
#include <inttypes.h>
#include <math.h>
#include <poll.h>
#include <signal.h>
#include <stdbool.h>
#include <stdio.h>
#include <string.h>
#include <time.h>

#include <lcm/lcm.h>

#include "app/network/command_gate.h"
#include "app/network/transport_url.h"
#include "support/say.h"

#include "arguments.h"
#include "pieces.h"
#include "plan.h"

#include "fovea_pose_t.h"
#include "fovea_run_t.h"
#include "fovea_velocity_command_t.h"

enum { QUIET_MOST = 15, POSES_WITHOUT_GRID = 50 };
static const int64_t grid_age_most_ns = 2000000000; /* what came since then is not in it */

static struct {
    lcm_t *lcm;
    struct navigate_arguments asked;
    char command_channel[64];
    uint8_t key[FV_SIPHASH_KEY_BYTES];
    int64_t run_id, counter;       /* with a key; run_id 0: not known yet */
    struct navigate_motion motion; /* the last that was asked for */
    struct navigate planner;
    struct navigate_grid grid;        /* as its pieces come */
    struct navigate_frame place;      /* of the grid that was planned on */
    fovea_run_t_subscription_t *runs; /* while the run to sign for is not known */
    bool planned, arrived, too_large; /* a grid was, which is said once */
    sigset_t waiting;                 /* signals that do not come while it waits for a message */
    int64_t grid_ns, frame, poses, grids, stood, silences;
} self = {.asked = {.prefix = "FOVEA", .robot = {0.2, 0.5, 1.2}, .patience_s = 2, .sender = 1}};

/* For this run alone, once, and by who knows the key: the message is encoded with mac 0, and then
 * with the code of these bytes. */
static void sign(fovea_velocity_command_t *command, int64_t now_ns)
{
    uint8_t data[256];
    self.counter = now_ns > self.counter ? now_ns : self.counter + 1; /* it must rise */
    command->run_id = self.run_id;
    command->sender = self.asked.sender;
    command->counter = self.counter;
    const int bytes = fovea_velocity_command_t_encode(data, 0, sizeof data, command);
    if (bytes > 0) command->mac = (int64_t)fv_siphash(self.key, data, (size_t)bytes, 0);
}

static void ask(int64_t sequence, struct navigate_motion motion)
{
    struct timespec now;
    self.motion = motion;
    if (self.asked.key_path != NULL && self.run_id == 0) return; /* on_run asks */
    clock_gettime(CLOCK_REALTIME, &now);
    fovea_velocity_command_t command = {.utime = now.tv_sec * INT64_C(1000000) + now.tv_nsec / 1000,
                                        .sequence = sequence,
                                        .velocity_m_s = {motion.speed_m_s, 0, 0},
                                        .angular_rate = {0, 0, motion.turning_rad_s}};
    if (self.asked.key_path != NULL) sign(&command, now.tv_sec * INT64_C(1000000000) + now.tv_nsec);
    fovea_velocity_command_t_publish(self.lcm, self.command_channel, &command);
}

/* Which run is to be signed for; the pose that came before is answered now. */
static void on_run(const lcm_recv_buf_t *packet, const char *channel, const fovea_run_t *run,
                   void *context)
{
    (void)packet;
    (void)channel;
    (void)context;
    if (self.run_id != 0) return;
    self.run_id = run->run_id;
    if (self.poses > 0) ask(self.frame, self.motion);
}

/* Once: nothing else tells why the robot stands. */
static void say_if_too_large(const fovea_grid_t *piece)
{
    const int32_t most = NAVIGATE_SIDE_MAX;
    if (self.too_large || (piece->width <= most && piece->height <= most)) return;
    self.too_large = true;
    fprintf(
        stderr,
        "navigate: GRID: found %d x %d cells, expected at most %d on a side (grid.side_cells)\n",
        (int)piece->width, (int)piece->height, (int)most);
}

/* A grid is planned on when it is whole. */
static void on_grid(const lcm_recv_buf_t *packet, const char *channel, const fovea_grid_t *piece,
                    void *context)
{
    const struct navigate_grid *grid = &self.grid;
    (void)packet;
    (void)channel;
    (void)context;
    if (!navigate_take(&self.grid, piece)) {
        say_if_too_large(piece);
        return;
    }
    self.grids++;
    self.grid_ns = grid->time_ns;
    if (memcmp(&self.place, &grid->frame, sizeof self.place) != 0) navigate_forget(&self.planner);
    self.place = grid->frame;
    self.planned = navigate_plan(&self.planner, grid->cells, grid->width, grid->height,
                                 grid->cell_m, grid->origin);
}

static bool is_usable(const fovea_pose_t *pose)
{
    return (pose->state == FOVEA_POSE_T_STATE_TRACKING || pose->state == FOVEA_POSE_T_STATE_WEAK) &&
           pose->scale_state == FOVEA_POSE_T_SCALE_METRIC;
}

static void on_pose(const lcm_recv_buf_t *packet, const char *channel, const fovea_pose_t *pose,
                    void *context)
{
    struct navigate_motion motion = {0};
    const double *q = pose->orientation;
    (void)packet;
    (void)channel;
    (void)context;
    self.poses++;
    if (self.poses == POSES_WITHOUT_GRID && self.grids == 0 && !self.too_large)
        fprintf(stderr,
                "navigate: found no GRID with %d poses, expected a run with grid.enabled and poses "
                "in metres; the robot stands\n",
                POSES_WITHOUT_GRID);
    self.frame = pose->stamp.sequence;
    const bool fresh = pose->stamp.time_ns - self.grid_ns <= grid_age_most_ns;
    if (is_usable(pose) && fresh && self.planned && navigate_is_for(&self.place, pose)) {
        const double yaw =
            atan2(2 * (q[0] * q[3] + q[1] * q[2]), 1 - 2 * (q[2] * q[2] + q[3] * q[3]));
        motion =
            navigate_steer(&self.planner, pose->position, yaw, (double)pose->stamp.time_ns * 1e-9);
        self.arrived = self.arrived || motion.arrived;
    } else {
        self.stood++;
    }
    ask(self.frame, motion);
}

/* Heard until the run is known: it is sent once a second, which would hide the silence of poses. */
static void unsubscribe_from_runs(bool now)
{
    if (!now || self.runs == NULL) return;
    fovea_run_t_unsubscribe(self.lcm, self.runs);
    self.runs = NULL;
}

static volatile sig_atomic_t ended;

static void on_end(int number)
{
    (void)number;
    ended = 1;
}

/* From here on signals come while a message is waited for, and at no other time; call it before LCM
 * begins a thread of its own. */
static void take_signals(void)
{
    const struct sigaction action = {.sa_handler = on_end};
    sigset_t signals;
    sigemptyset(&signals);
    sigaddset(&signals, SIGINT);
    sigaddset(&signals, SIGTERM);
    sigprocmask(SIG_BLOCK, &signals, &self.waiting);
    sigdelset(&self.waiting, SIGINT);
    sigdelset(&self.waiting, SIGTERM);
    sigaction(SIGINT, &action, NULL);
    sigaction(SIGTERM, &action, NULL);
}

/* A message, when one comes in that time: 1; else 0, as when a signal comes; -1: LCM failed. */
static int handle_within(int ms)
{
    struct pollfd lcm = {.fd = lcm_get_fileno(self.lcm), .events = POLLIN};
    const struct timespec most = {ms / 1000, ms % 1000 * 1000000};
    const int ready = ppoll(&lcm, 1, &most, &self.waiting);
    if (ready < 0) return errno == EINTR ? 0 : -1;
    if (ready == 0) return 0;
    return lcm_handle(self.lcm) < 0 ? -1 : 1;
}

/* Until the run has been silent for long after its first pose, as at its end, or a signal comes. A
 * pose or an answer may be lost, or have been sent before this program listened: after some seconds
 * of silence whichever frame waits is answered, so that lock-step goes on. */
static void drive(void)
{
    int quiet = 0;
    while (quiet < (self.arrived ? 2 : QUIET_MOST)) {
        const int handled = handle_within((int)ceil(1000 * self.asked.patience_s));
        if (handled < 0) return;
        if (ended) break;
        quiet = handled > 0 || self.poses == 0 ? 0 : quiet + 1;
        if (handled == 0) {
            self.silences++;
            ask(-1, (struct navigate_motion){0});
        }
        unsubscribe_from_runs(self.run_id != 0);
    }
    if (ended) ask(-1, (struct navigate_motion){0});
}

int main(int argc, char **argv)
{
    const struct navigate_arguments *asked = &self.asked;
    struct fovea_error error;
    char channel[64];
    if (argc == 2 && strcmp(argv[1], "--help") == 0) {
        printf("usage: navigate X Y [--url URL] [--prefix FOVEA] [--radius M] [--speed M_S] "
               "[--turning RAD_S] [--patience S] [--key FILE [--run-id N] [--sender N]]\n");
        return FV_EXIT_OK;
    }
    if (!navigate_arguments_read(&self.asked, argc, argv)) return FV_EXIT_WRONG;
    if (asked->url != NULL && fv_transport_url_check(asked->url, &error) != FOVEA_OK)
        return fv_say_wrong("navigate: --url: %s", error.text);
    if (asked->url != NULL && fv_transport_reachable(asked->url, &error) != FOVEA_OK)
        return fv_say_failed("navigate: --url: %s", error.text);
    if (asked->key_path != NULL && fv_command_key_read(asked->key_path, self.key, &error) < 0)
        return fv_say_wrong("navigate: --key: %s", error.text);
    self.run_id = asked->run_id;
    take_signals();
    self.lcm = lcm_create(asked->url);
    if (self.lcm == NULL)
        return fv_say_failed("navigate: %s: LCM cannot be opened",
                             asked->url != NULL ? asked->url : "default URL");
    navigate_init(&self.planner, &asked->robot, asked->goal);
    snprintf(self.command_channel, sizeof self.command_channel, "%s_VELOCITY_COMMAND",
             asked->prefix);
    snprintf(channel, sizeof channel, "%s_GRID", asked->prefix);
    fovea_grid_t_subscription_t *grids = fovea_grid_t_subscribe(self.lcm, channel, on_grid, NULL);
    snprintf(channel, sizeof channel, "%s_POSE", asked->prefix);
    fovea_pose_t_subscription_t *poses = fovea_pose_t_subscribe(self.lcm, channel, on_pose, NULL);
    if (grids == NULL || poses == NULL) return FV_EXIT_FAILED;
    snprintf(channel, sizeof channel, "%s_RUN", asked->prefix);
    if (asked->key_path != NULL && self.run_id == 0)
        self.runs = fovea_run_t_subscribe(self.lcm, channel, on_run, NULL);
    printf("listening\n");
    fflush(stdout);
    drive();
    printf("%s after %" PRId64 " poses, of which %" PRId64 " could not be steered by; %" PRId64
           " grids; stood against its command %" PRId64 " times; gave up %" PRId64
           " ways that were too narrow; asked to stand after silence %" PRId64 " times\n",
           self.arrived ? "at the goal" : "not at the goal", self.poses, self.stood, self.grids,
           self.planner.touches - self.planner.given_up, self.planner.given_up, self.silences);
    unsubscribe_from_runs(true);
    fovea_grid_t_unsubscribe(self.lcm, grids);
    fovea_pose_t_unsubscribe(self.lcm, poses);
    lcm_destroy(self.lcm);
    return self.arrived ? FV_EXIT_OK : FV_EXIT_FAILED;
}

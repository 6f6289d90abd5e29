#include "app/watch/robots_print.h"

#include <inttypes.h>
#include <math.h>
#include <stdarg.h>
#include <string.h>

#include "support/json.h"
#include "support/utf8.h"

enum { LINE_BYTES = 1024, NUMBER_BYTES = 24 };

/* ---- a table --------------------------------------------------------------------------------- */

struct line {
    char text[LINE_BYTES];
    size_t length;
};

__attribute__((format(printf, 2, 3))) static void add(struct line *line, const char *format, ...)
{
    va_list arguments;
    const size_t room = sizeof line->text - line->length;
    va_start(arguments, format);
    const int wanted = vsnprintf(line->text + line->length, room, format, arguments);
    va_end(arguments);
    if (wanted > 0) line->length += (size_t)wanted < room ? (size_t)wanted : room - 1;
}

/* "12.3", or "-" for what is not known. */
static const char *number(double value, int decimals, char text[NUMBER_BYTES])
{
    if (isnan(value))
        snprintf(text, NUMBER_BYTES, "-");
    else if (fabs(value) >= 1e7)
        snprintf(text, NUMBER_BYTES, "%.1e", value);
    else
        snprintf(text, NUMBER_BYTES, "%.*f", decimals, value);
    return text;
}

/* Bytes of the first `columns` letters. */
static size_t cut_at(const char *text, unsigned columns)
{
    size_t at = 0;
    for (unsigned i = 0; text[at] != '\0' && (columns == 0 || i < columns); i++) {
        uint32_t code;
        const int bytes = fv_utf8_decode(text + at, &code);
        at += bytes > 0 ? (size_t)bytes : 1;
    }
    return at;
}

static void put(FILE *out, const struct line *line, const char *colour,
                const struct fv_robots_look *look)
{
    const bool coloured = look->screen && colour[0] != '\0';
    fprintf(out, "%s%.*s%s%s\n", coloured ? colour : "", (int)cut_at(line->text, look->columns),
            line->text, coloured ? "\033[0m" : "", look->screen ? "\033[K" : "");
}

static bool silent(const struct fv_robots *robots, const struct fv_robot *robot)
{
    return robots->now_ns - robot->heard_ns >= FV_ROBOT_SILENT_NS;
}

static const char *state_of(const struct fv_robots *robots, const struct fv_robot *robot)
{
    if (silent(robots, robot)) return "silent";
    return robot->state < 0 ? "-" : fv_robot_state_name(robot->state);
}

static const char *colour_of(const char *state)
{
    if (strcmp(state, "tracking") == 0) return "\033[32m";
    if (strcmp(state, "lost") == 0 || strcmp(state, "silent") == 0) return "\033[31m";
    return strcmp(state, "-") == 0 ? "" : "\033[33m";
}

/* Since the state changed, or since something was heard of a silent one. */
static double state_seconds(const struct fv_robots *robots, const struct fv_robot *robot)
{
    if (silent(robots, robot)) return (double)(robots->now_ns - robot->heard_ns) * 1e-9;
    return robot->state < 0 ? NAN : (double)(robots->now_ns - robot->state_since_ns) * 1e-9;
}

static void heading_line(struct line *line)
{
    add(line, "%-12s %-9s %7s %5s %6s %6s %7s %7s %7s %6s %6s  %-9s %5s %6s  %s", "PREFIX", "STATE",
        "FOR s", "QUAL", "FRAME/s", "POSE/s", "MEAN ms", "MAX ms", "LATENCY", "LATE", "LATE/s",
        "CAMERA", "TEMP", "MiB", "HOST");
}

static void robot_line(const struct fv_robots *robots, const struct fv_robot *robot,
                       struct line *line)
{
    char a[NUMBER_BYTES], b[NUMBER_BYTES], c[NUMBER_BYTES], d[NUMBER_BYTES], e[NUMBER_BYTES];
    add(line, "%-12s %-9s %7s %5s %7s %6s ", robot->prefix, state_of(robots, robot),
        number(state_seconds(robots, robot), 1, a), number(robot->quality, 2, b),
        number(robot->frames_hz, 1, c), number(robot->poses_hz, 1, d));
    add(line, "%7s %7s %7s %6s %6s", number(robot->frame_mean_ms, 2, a),
        number(robot->frame_max_ms, 2, b), number(robot->latency_ms, 1, c),
        number(robot->counted ? (double)robot->late : NAN, 0, d), number(robot->late_hz, 1, e));
    add(line, "  %-9s %5s %6s  %s",
        robot->camera_state < 0 ? "-" : fv_robot_camera_name(robot->camera_state),
        number(robot->temperature_c, 1, a),
        number(robot->resident_bytes > 0 ? (double)robot->resident_bytes / 1048576 : NAN, 1, b),
        robot->run_id != 0 ? robot->host : "-");
}

static void stages_line(const struct fv_robot *robot, struct line *line)
{
    char text[NUMBER_BYTES];
    add(line, "  ms:");
    for (uint32_t i = 0; i < robot->stage_count; i++)
        add(line, "  %s %s", robot->stages[i].name, number(robot->stages[i].mean_ms, 2, text));
}

static void faults_put(FILE *out, const struct fv_robot *robot, const struct fv_robots_look *look)
{
    struct line line = {.length = 0};
    add(&line, "  %s", robot->faults);
    put(out, &line, robot->health == 1 ? "\033[33m" : "\033[31m", look);
}

void fv_robots_table(FILE *out, const struct fv_robots *robots, const struct fv_robots_look *look)
{
    unsigned left = look->lines > 0 ? look->lines : 1u << 30;
    struct line heading = {.length = 0};
    heading_line(&heading);
    put(out, &heading, "\033[1m", look);
    for (uint32_t i = 0; i < robots->count && left > 1; i++) {
        const struct fv_robot *robot = &robots->robots[i];
        struct line line = {.length = 0}, stages = {.length = 0};
        robot_line(robots, robot, &line);
        put(out, &line, colour_of(state_of(robots, robot)), look);
        left--;
        if (robot->faults[0] != '\0' && left > 1) {
            faults_put(out, robot, look);
            left--;
        }
        if (robot->stage_count == 0 || left <= 1) continue;
        stages_line(robot, &stages);
        put(out, &stages, "", look);
        left--;
    }
}

/* ---- JSON ------------------------------------------------------------------------------------ */

static void member(FILE *out, const char *name, double value)
{
    if (isfinite(value))
        fprintf(out, ",\"%s\":%.9g", name, value);
    else
        fprintf(out, ",\"%s\":null", name);
}

static void member_text(FILE *out, const char *name, const char *text)
{
    fprintf(out, ",\"%s\":", name);
    if (text != NULL)
        fv_json_text(out, text);
    else
        fputs("null", out);
}

static void member_count(FILE *out, const char *name, bool known, int64_t count)
{
    if (known)
        fprintf(out, ",\"%s\":%" PRId64, name, count);
    else
        fprintf(out, ",\"%s\":null", name);
}

static void stages_json(FILE *out, const struct fv_robot *robot)
{
    fputs(",\"stages_mean_ms\":{", out);
    for (uint32_t i = 0; i < robot->stage_count; i++) {
        if (i > 0) fputc(',', out);
        fv_json_text(out, robot->stages[i].name);
        if (isfinite(robot->stages[i].mean_ms))
            fprintf(out, ":%.6g", robot->stages[i].mean_ms);
        else
            fputs(":null", out);
    }
    fputs("}}\n", out);
}

static void pose_json(FILE *out, const struct fv_robots *robots, const struct fv_robot *robot)
{
    const bool posed = robot->state >= 0;
    member_text(out, "state", posed ? fv_robot_state_name(robot->state) : NULL);
    member(out, "state_s", posed ? (double)(robots->now_ns - robot->state_since_ns) * 1e-9 : NAN);
    member(out, "quality", robot->quality);
    member_count(out, "inliers", posed, robot->inliers);
    member_count(out, "map_id", posed, robot->map_id);
    member_count(out, "reset_counter", posed, robot->reset_counter);
    member_text(out, "scale", posed ? fv_robot_scale_name(robot->scale_state) : NULL);
    fputs(",\"position\":[", out);
    for (int i = 0; i < 3; i++) {
        if (isfinite(robot->position[i]))
            fprintf(out, "%s%.17g", i > 0 ? "," : "", robot->position[i]);
        else
            fprintf(out, "%snull", i > 0 ? "," : "");
    }
    fputc(']', out);
}

void fv_robots_json(FILE *out, const struct fv_robots *robots, const struct fv_robot *robot,
                    int64_t utime)
{
    const bool run = robot->run_id != 0, counted = robot->counted;
    fprintf(out, "{\"utime\":%" PRId64, utime);
    member_text(out, "prefix", robot->prefix);
    fprintf(out, ",\"silent\":%s", silent(robots, robot) ? "true" : "false");
    member(out, "heard_s", (double)(robots->now_ns - robot->heard_ns) * 1e-9);
    fprintf(out, ",\"from_host\":%s", robot->from_host ? "true" : "false");
    member_count(out, "run_id", run, robot->run_id);
    member_count(out, "restarts", run, robot->restarts);
    member_text(out, "host", run ? robot->host : NULL);
    member_count(out, "process", run, robot->process);
    member_text(out, "version", run ? robot->version : NULL);
    pose_json(out, robots, robot);
    member(out, "frames_hz", robot->frames_hz);
    member(out, "poses_hz", robot->poses_hz);
    member(out, "frame_mean_ms", robot->frame_mean_ms);
    member(out, "frame_max_ms", robot->frame_max_ms);
    member(out, "latency_ms", robot->latency_ms);
    member(out, "late_hz", robot->late_hz);
    member_count(out, "late", counted, robot->late);
    member_count(out, "processed", counted, robot->processed);
    member_count(out, "refused", counted, robot->refused);
    member_count(out, "dropped", counted, robot->dropped);
    member_count(out, "damaged", counted, robot->damaged);
    const bool camera = robot->camera_state >= 0;
    member_text(out, "camera", camera ? fv_robot_camera_name(robot->camera_state) : NULL);
    member_count(out, "width", camera, robot->width);
    member_count(out, "height", camera, robot->height);
    member(out, "temperature_c", robot->temperature_c);
    member_count(out, "resident_bytes", robot->resident_bytes > 0, robot->resident_bytes);
    member_text(out, "health", robot->health >= 0 ? fv_robot_health_name(robot->health) : NULL);
    member_text(out, "faults", robot->health >= 0 ? robot->faults : NULL);
    stages_json(out, robot);
}

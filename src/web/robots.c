#include "web/robots.h"

#include <stdio.h>
#include <string.h>

#include "app/watch/robots.h"

static void write_text(struct fv_web_robots *robots)
{
    size_t used = 0;
    for (uint32_t i = 0; i < robots->count; i++) {
        const struct fv_web_robot *robot = &robots->robots[i];
        used += (size_t)snprintf(
            robots->text + used, sizeof robots->text - used,
            "%s{\"name\":\"%s\",\"running\":%s,\"state\":\"%s\"}", i == 0 ? "[" : ",", robot->name,
            robot->running ? "true" : "false",
            robot->running && robot->state >= 0 ? fv_robot_state_name(robot->state) : "");
    }
    snprintf(robots->text + used, sizeof robots->text - used, "]");
    robots->version++;
}

/* Letters that mean something in JSON, and all that are not plain, become '?'. */
static void name_robot(struct fv_web_robot *robot, const char *name)
{
    const char *slash = strrchr(name, '/');
    snprintf(robot->name, sizeof robot->name, "%.*s", FV_WEB_ROBOT_NAME_BYTES - 1,
             slash != NULL ? slash + 1 : name);
    char *end = strrchr(robot->name, '.');
    if (end != NULL && strcmp(end, ".sock") == 0) *end = '\0';
    for (char *c = robot->name; *c != '\0'; c++)
        if (*c < ' ' || *c > '~' || *c == '"' || *c == '\\') *c = '?';
}

bool fv_web_robots_add(struct fv_web_robots *robots, struct fv_web_relay *relay, const char *name)
{
    if (robots->count == FV_WEB_ROBOTS_MAX) return false;
    struct fv_web_robot *robot = &robots->robots[robots->count++];
    *robot = (struct fv_web_robot){.relay = relay, .state = -1};
    name_robot(robot, name);
    write_text(robots);
    return true;
}

bool fv_web_robots_tick(struct fv_web_robots *robots, bool *pictured)
{
    bool changed = false, news = false;
    *pictured = false;
    for (uint32_t i = 0; i < robots->count; i++) {
        struct fv_web_robot *robot = &robots->robots[i];
        const struct fv_web_store *store = robot->relay->store;
        const uint32_t shown = store->picture.number;
        changed |= fv_web_relay_tick(robot->relay, robot->relay->cameras != 0);
        *pictured |= store->picture.number != shown;
        news |= store->running != robot->running || robot->relay->state != robot->state;
        robot->running = store->running;
        robot->state = robot->relay->state;
    }
    if (news) write_text(robots);
    return changed || news;
}

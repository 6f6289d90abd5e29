/* fovea top: robots that run, on a full screen, as a table or as JSON. */
#include <inttypes.h>
#include <poll.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/ioctl.h>
#include <termios.h>
#include <unistd.h>

#include "app/config/options.h"
#include "app/watch/bus.h"
#include "app/watch/commands.h"
#include "app/watch/robots_print.h"
#include "drivers/clock.h"

enum { KEY_MS = 100 }; /* how long a key may wait */

struct top {
    struct fv_bus bus;
    struct fv_robots robots;
    uint64_t interval_s;
    bool once, json;
};

/* ---- the screen ------------------------------------------------------------------------------ */

static volatile sig_atomic_t resized;

static void on_resize(int signal)
{
    (void)signal;
    resized = 1;
}

/* Keys come at once and are not shown. False: stdin is no terminal. */
static bool keys_begin(struct termios *before)
{
    if (tcgetattr(STDIN_FILENO, before) != 0) return false;
    struct termios raw = *before;
    raw.c_lflag &= ~(tcflag_t)(ICANON | ECHO);
    raw.c_cc[VMIN] = 1;
    raw.c_cc[VTIME] = 0;
    return tcsetattr(STDIN_FILENO, TCSANOW, &raw) == 0;
}

/* Whether q was pressed; `*keys` falls when the terminal is gone. */
static bool key_ends(bool *keys)
{
    struct pollfd in = {.fd = STDIN_FILENO, .events = POLLIN};
    char key;
    if (!*keys || poll(&in, 1, 0) <= 0) return false;
    if (read(STDIN_FILENO, &key, 1) == 1) return key == 'q' || key == 'Q';
    *keys = false;
    return false;
}

static struct fv_robots_look look_of_terminal(void)
{
    struct winsize size;
    struct fv_robots_look look = {80, 24, true};
    if (ioctl(STDOUT_FILENO, TIOCGWINSZ, &size) == 0 && size.ws_col > 0 && size.ws_row > 0) {
        look.columns = size.ws_col;
        look.lines = size.ws_row;
    }
    return look;
}

static void put_limited(const char *text, const struct fv_robots_look *look)
{
    printf("%.*s\033[K\n", (int)look->columns, text);
}

static void draw(const struct top *top)
{
    struct fv_robots_look look = look_of_terminal();
    char title[160], more[64] = "";
    if (top->robots.crowded > 0)
        snprintf(more, sizeof more, "; no room for more: %" PRIu64 " messages left out",
                 top->robots.crowded);
    snprintf(title, sizeof title, "fovea top: %" PRIu32 " running%s; q ends", top->robots.count,
             more);
    fputs("\033[H", stdout);
    put_limited(title, &look);
    look.lines = look.lines > 3 ? look.lines - 2 : 1;
    fv_robots_table(stdout, &top->robots, &look);
    fputs("\033[J", stdout);
    fflush(stdout);
}

/* ---- listening ------------------------------------------------------------------------------- */

/* Hear for a while: until the interval is over, or something on the screen changes by hand. False:
 * to end. */
static bool listen_on(struct top *top, int64_t until_ns, bool *keys)
{
    const bool screen = keys != NULL;
    for (;;) {
        const int64_t now_ns = fv_clock_ns(CLOCK_MONOTONIC);
        if (fv_bus_ended() || (screen && key_ends(keys))) return false;
        if (now_ns >= until_ns || (screen && resized)) break;
        const int64_t step_ns = now_ns + KEY_MS * INT64_C(1000000);
        top->robots.now_ns = now_ns;
        fv_bus_wait(&top->bus, step_ns < until_ns ? step_ns : until_ns);
    }
    top->robots.now_ns = fv_clock_ns(CLOCK_MONOTONIC);
    fv_robots_tick(&top->robots);
    return true;
}

static void show_screen(struct top *top)
{
    struct sigaction action = {.sa_handler = on_resize};
    struct termios before;
    bool keys = keys_begin(&before);
    const bool restore = keys;
    sigemptyset(&action.sa_mask);
    sigaction(SIGWINCH, &action, NULL);
    fputs("\033[?1049h\033[?25l\033[?7l", stdout); /* a screen of its own, no cursor, no wrapping */
    int64_t until_ns = fv_clock_ns(CLOCK_MONOTONIC);
    do {
        if (!resized) until_ns += (int64_t)top->interval_s * FV_SECOND_NS;
        resized = 0;
        draw(top);
    } while (!ferror(stdout) && listen_on(top, until_ns, &keys));
    fputs("\033[?7h\033[?25h\033[?1049l", stdout);
    fflush(stdout);
    if (restore) tcsetattr(STDIN_FILENO, TCSANOW, &before);
}

static void print_once(const struct top *top)
{
    const int64_t utime = fv_clock_ns(CLOCK_REALTIME) / 1000;
    if (top->json)
        for (uint32_t i = 0; i < top->robots.count; i++)
            fv_robots_json(stdout, &top->robots, &top->robots.robots[i], utime);
    else if (top->robots.count > 0)
        fv_robots_table(stdout, &top->robots, &(struct fv_robots_look){0});
    fflush(stdout);
}

static void print_lines(struct top *top)
{
    int64_t until_ns = fv_clock_ns(CLOCK_MONOTONIC);
    do
        until_ns += (int64_t)top->interval_s * FV_SECOND_NS;
    while (listen_on(top, until_ns, NULL) && (print_once(top), !top->once && !ferror(stdout)));
}

static int run(struct top *top, const char *prefix)
{
    struct fv_receiver_channel rows[FV_ROBOT_ROWS];
    struct fovea_error error;
    const bool screen = !top->once && !top->json;
    if (screen && isatty(STDOUT_FILENO) != 1)
        return fv_say_wrong("fovea top: found a standard output that is no terminal, expected one, "
                            "or --once, or --json");
    /* --once shows all that was heard, however late in the interval it began. */
    fv_robots_init(&top->robots,
                   top->once ? 1 : (int64_t)top->interval_s * (FV_SECOND_NS * 9 / 10));
    enum fovea_status status = fv_robots_rows(&top->robots, prefix, rows, &error);
    if (status == FOVEA_OK) status = fv_bus_open(&top->bus, rows, FV_ROBOT_ROWS, &error);
    if (status != FOVEA_OK)
        return status == FOVEA_ERROR_INPUT ? fv_say_wrong("fovea top: %s", error.text)
                                           : fv_say_failed("fovea top: %s", error.text);
    if (screen)
        show_screen(top);
    else
        print_lines(top);
    fv_bus_close(&top->bus);
    if (top->once && top->robots.count == 0 && !fv_bus_ended())
        return fv_say_failed("fovea top: nothing is heard of a robot in %" PRIu64
                             " s ('fovea check' says what keeps messages back)",
                             top->interval_s);
    return FV_EXIT_OK;
}

int fv_command_top(int argc, char **argv)
{
    struct top *top = calloc(1, sizeof *top);
    if (top == NULL) return fv_say_failed("fovea top: no memory");
    top->interval_s = 2;
    const struct fv_option options[] = {
        {"once", NULL, FV_OPTION_FLAG, &top->once,
         "listen for one interval, print a table and end; the exit status is 1 when no robot is "
         "heard"},
        {"json", NULL, FV_OPTION_FLAG, &top->json,
         "print one line of JSON for each robot after each interval; null is what is not known"},
        {"interval", "SECONDS", FV_OPTION_POSITIVE, &top->interval_s,
         "between two screens, and what rates and times are counted over (default 2)"},
        FV_BUS_OPTIONS(top->bus),
        {0},
    };
    int first;
    const enum fv_options_result result =
        fv_options_parse(options, "[PREFIX]", 0, 1, argc, argv, &first);
    int status = result == FV_OPTIONS_HELP ? FV_EXIT_OK : FV_EXIT_WRONG;
    if (result == FV_OPTIONS_READ) {
        if (top->interval_s > 3600) top->interval_s = 3600;
        status = run(top, first < argc ? argv[first] : "*");
    }
    free(top);
    return status;
}

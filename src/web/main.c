/* fovea-web: the page of a running robot. */
#include <arpa/inet.h>
#include <errno.h>
#include <signal.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/prctl.h>
#include <unistd.h>

#include "app/config/options.h"
#include "fovea/fovea.h"
#include "message/message.h"
#include "support/man.h"
#include "support/say.h"
#include "support/text.h"
#include "web/heard.h"
#include "web/robots.h"
#include "web/server.h"

#define URL_DEFAULT "udpm://239.255.76.67:7667"
#define SOCKET_DEFAULT "/run/fovea/front.sock"

enum { PORT_DEFAULT = 7680, RATE_DEFAULT = 15, RATE_MAX = 60 };

struct web {
    const char *origins; /* of Foxglove's clients */
    const char *play, *lcm, *listen, *address, *token, *url, *key;
    const char *recordings; /* folder */
    struct fv_web_calibration calibration;
    struct fv_option_list feeds, prefixes; /* robots of this host; heard ones */
    uint64_t port, rate;
    uint64_t with_parent; /* process; 0: none */
    struct fv_option_list names;
    struct fv_web_certificate certificate;
    bool make_certificate;
    struct fv_web_tokens tokens;
    struct fv_web_robots robots;
    struct fv_web_heard heard[FV_WEB_ROBOTS_MAX];
    struct fv_web_commander commander;
};

static struct fv_web_server *_Atomic served;

static void on_end(int signal)
{
    const int kept = errno;
    struct fv_web_server *server = atomic_load(&served);
    (void)signal;
    if (server != NULL)
        fv_web_server_stop(server);
    else
        _exit(FV_EXIT_OK);
    errno = kept;
}

static void describe(void)
{
    fv_options_describe(&(struct fv_options_page){
        .help = "show a running robot as a page in a browser",
        .description =
            "Serves a page with the live picture and what is found in it, the pose, the path and "
            "the map, times, and the log of a run of fovea on this host, and sends commands to it. "
            "The run offers its feed by the key web.socket; it is not slowed by those who look. "
            "'fovea run --web' starts this program beside the run.\n\n"
            "The page can be reached from this host alone, unless --address says otherwise: then "
            "--token is needed, and without --certificate all that the page shows is readable on "
            "the network, since it is not encrypted.",
        .program = "fovea-web"});
}

static void man_end(void)
{
    fv_man_section("EXAMPLES");
    fv_man_example(
        "fovea run --source v4l2:/dev/video0 --web\n"
        "fovea-web --play run.lcm\n"
        "fovea-web --lcm udpm://239.255.76.67:7667 --prefix LEFT_ROBOT --prefix RIGHT_ROBOT\n"
        "fovea-web --feed /run/fovea/front.sock --address 0.0.0.0 --name robot.local "
        "--token /var/lib/fovea/web.token --certificate /var/lib/fovea/web.crt "
        "--certificate-key /var/lib/fovea/web.key --make-certificate");
    fv_man_reference("fovea", NULL, true);
    fv_man_reference("fovea", "run", false);
    putchar('\n');
}

static enum fv_options_result options_read(struct web *web, int argc, char **argv)
{
    const struct fv_option options[] = {
        {"feed", "SOCKET", FV_OPTION_LIST, &web->feeds,
         "the run on this host whose key web.socket names this socket (default " SOCKET_DEFAULT
         "); it may start later, and be restarted; several of them are robots that the page chooses "
         "from, eight at most with heard ones"},
        {"play", "RECORDING", FV_OPTION_TEXT, &web->play,
         "in place of a run show a recording of one, which is read alone: play, pause, position "
         "and speed are on the page"},
        {"lcm", "URL", FV_OPTION_TEXT, &web->lcm,
         "in place of a run of this host, or beside those of --feed, hear a robot of another one at "
         "this LCM URL: its messages, and its previews as pictures, at their rate; no commands"},
        {"listen", "WHOM", FV_OPTION_TEXT, &web->listen,
         "with --lcm, who is heard: loopback, the name of an interface, or any (default)"},
        {"prefix", "P", FV_OPTION_LIST, &web->prefixes,
         "with --lcm, the robot's channel_prefix (default FOVEA); several are several robots"},
        {"port", "N", FV_OPTION_COUNT, &web->port,
         "TCP port of the page (default 7680; 0: one that is free)"},
        {"address", "A", FV_OPTION_TEXT, &web->address,
         "IPv4 address to listen at (default 127.0.0.1: this host alone; 0.0.0.0: every network, "
         "with --token)"},
        {"name", "HOST", FV_OPTION_LIST, &web->names,
         "a further name by which browsers call this host, such as robot.local"},
        {"origins", "LIST", FV_OPTION_TEXT, &web->origins,
         "origins, with spaces between, that pages of Foxglove and Lichtblick may come from, such as "
         "'https://app.foxglove.dev http://localhost:8080' (the key web.origins of a run)"},
        {"token", "FILE", FV_OPTION_TEXT, &web->token,
         "the page asks for a token of this file; without such a file one is made (two tokens: to "
         "view, and to operate)"},
        {"certificate", "FILE", FV_OPTION_TEXT, &web->certificate.file,
         "serve HTTPS with this certificate (PEM, those that signed it behind it)"},
        {"certificate-key", "FILE", FV_OPTION_TEXT, &web->certificate.key_file,
         "the key of the certificate (PEM)"},
        {"make-certificate", NULL, FV_OPTION_FLAG, &web->make_certificate,
         "make both files where there are none: a certificate that signs itself, for localhost, "
         "--address and every --name"},
        {"recordings", "FOLDER", FV_OPTION_TEXT, &web->recordings,
         "the page lists the recordings in this folder (the key record_folder of a run), and who "
         "may operate may download them: they hold the configuration, too"},
        {"calibrations", "FOLDER", FV_OPTION_TEXT, &web->calibration.folder,
         "the page calibrates the camera of a run of this host by fovea-calibrate, whose page is at "
         "the next port, and whose camera files go to this folder"},
        {"rate", "HZ", FV_OPTION_POSITIVE, &web->rate,
         "pictures in a second, at most (default 15; web.picture_rate of the run is the limit)"},
        {"lcm-url", "URL", FV_OPTION_TEXT, &web->url,
         "where the run hears commands: its lcm_url (default udpm://239.255.76.67:7667; empty: the "
         "page sends no commands)"},
        {"command-key", "FILE", FV_OPTION_TEXT, &web->key, "key of commands: its command_key"},
        {"with-parent", "PROCESS", FV_OPTION_POSITIVE, &web->with_parent,
         "end when this process ends, which started this one"},
        {0},
    };
    int first;
    describe();
    const enum fv_options_result result = fv_options_parse(options, "", 0, 0, argc, argv, &first);
    if (result == FV_OPTIONS_HELP && fv_options_man_printed()) man_end();
    return result;
}

/* Where robots come from, with what stands for it where nothing is said. */
static enum fovea_status robots_check(struct web *web, struct fovea_error *error)
{
    if ((web->play != NULL && web->lcm != NULL) ||
        (web->lcm == NULL && (web->listen != NULL || web->prefixes.count > 0)))
        return fovea_error_set(error, FOVEA_ERROR_INPUT,
                               web->lcm == NULL
                                   ? "found --listen or --prefix, expected them with --lcm alone"
                                   : "found --play and --lcm, expected one of them");
    const char *of_run = web->feeds.count > 0 ? "--feed"
                         : web->url != NULL   ? "--lcm-url"
                         : web->key != NULL   ? "--command-key"
                                              : NULL;
    if ((web->play != NULL || (web->lcm != NULL && web->feeds.count == 0)) && of_run != NULL)
        return fovea_error_set(
            error, FOVEA_ERROR_INPUT, "found %s and %s, expected one of them: %s",
            web->play != NULL ? "--play" : "--lcm", of_run,
            web->play != NULL ? "there is no run to ask where a recording is played"
                              : "nothing is asked of a robot that is heard");
    if (web->play == NULL && web->lcm == NULL && web->feeds.count == 0)
        web->feeds.values[web->feeds.count++] = SOCKET_DEFAULT;
    if (web->lcm != NULL && web->prefixes.count == 0)
        web->prefixes.values[web->prefixes.count++] = "FOVEA";
    if (web->feeds.count + web->prefixes.count > FV_WEB_ROBOTS_MAX)
        return fovea_error_set(error, FOVEA_ERROR_INPUT,
                               "found %d robots by --feed and --prefix, expected at most %d",
                               web->feeds.count + web->prefixes.count, FV_WEB_ROBOTS_MAX);
    return FOVEA_OK;
}

/* FOVEA_ERROR_INPUT: what was asked for cannot be, or is not safe. */
static enum fovea_status options_check(struct web *web, struct fovea_error *error)
{
    if (web->port > UINT16_MAX || web->rate > RATE_MAX)
        return fovea_error_set(error, FOVEA_ERROR_INPUT,
                               "found --port %llu and --rate %llu, expected at most 65535 and %d",
                               (unsigned long long)web->port, (unsigned long long)web->rate,
                               RATE_MAX);
    if (web->names.count > FV_WEB_NAMES_MAX)
        return fovea_error_set(error, FOVEA_ERROR_INPUT,
                               "found %d times --name, expected at most %d", web->names.count,
                               FV_WEB_NAMES_MAX);
    if ((web->certificate.file == NULL) != (web->certificate.key_file == NULL) ||
        (web->make_certificate && web->certificate.file == NULL))
        return fovea_error_set(error, FOVEA_ERROR_INPUT,
                               "found one of --certificate, --certificate-key and "
                               "--make-certificate alone, expected the first two together");
    if (web->calibration.folder != NULL && web->feeds.count == 0 &&
        (web->play != NULL || web->lcm != NULL))
        return fovea_error_set(error, FOVEA_ERROR_INPUT,
                               "found --calibrations without a run of this host (--feed)");
    if (web->calibration.folder != NULL && access(web->calibration.folder, W_OK) != 0)
        return fovea_error_set(error, FOVEA_ERROR_INPUT, "--calibrations: %.300s: %s",
                               web->calibration.folder, strerror(errno));
    if (web->origins != NULL && fv_web_origins_check(web->origins, error) != FOVEA_OK)
        return FOVEA_ERROR_INPUT;
    const enum fovea_status status = robots_check(web, error);
    if (status != FOVEA_OK) return status;
    if (web->url == NULL) web->url = URL_DEFAULT;
    return fv_web_address_check(web->address, web->token != NULL, error);
}

static enum fovea_status certificate_open(struct web *web, struct fovea_error *error)
{
    bool made = false;
    enum fovea_status status = FOVEA_OK;
    if (web->certificate.file == NULL) return FOVEA_OK;
    if (web->make_certificate)
        status = fv_web_certificate_make(&web->certificate, web->names.values, web->names.count,
                                         web->address, &made, error);
    if (status == FOVEA_OK && made)
        fv_say_note("fovea-web: made %s, which browsers ask about once, since it signs itself",
                    web->certificate.file);
    return status == FOVEA_OK ? fv_web_certificate_check(&web->certificate, error) : status;
}

static enum fovea_status tokens_open(struct web *web, struct fovea_error *error)
{
    bool made;
    if (web->token == NULL) return FOVEA_OK;
    const enum fovea_status status = fv_web_tokens_read(web->token, &web->tokens, &made, error);
    if (status == FOVEA_OK && made)
        fv_say_note("fovea-web: made %s: its first token is to view, its second to operate",
                    web->token);
    return status;
}

static enum fovea_status serve(struct web *web, struct fovea_error *error)
{
    struct fv_web_server *server;
    const struct fv_web_setup setup = {.address = web->address,
                                       .port = (uint16_t)web->port,
                                       .names = web->names.values,
                                       .name_count = web->names.count,
                                       .origins = web->origins,
                                       .certificate = web->certificate,
                                       .tokens = web->token != NULL ? &web->tokens : NULL,
                                       .robots = &web->robots,
                                       .recordings = web->recordings,
                                       .calibration = &web->calibration,
                                       .commander = &web->commander};
    enum fovea_status status = fv_web_server_open(&setup, &server, error);
    if (status != FOVEA_OK) return status;
    web->calibration.address = web->address;
    web->calibration.name = web->names.count > 0 ? web->names.values[0] : NULL;
    web->calibration.token = web->token;
    web->calibration.certificate = web->certificate.file;
    web->calibration.certificate_key = web->certificate.key_file;
    web->calibration.port = (uint16_t)(fv_web_server_port(server) + 1);
    const bool all = strcmp(web->address, "0.0.0.0") == 0;
    const char *host = all && web->names.count > 0 ? web->names.values[0]
                       : all                       ? "127.0.0.1"
                                                   : web->address;
    atomic_store(&served, server);
    const bool encrypted = web->certificate.file != NULL;
    fv_say_note("fovea-web: http%s://%s:%u/", encrypted ? "s" : "", host,
                (unsigned)fv_web_server_port(server));
    fv_web_server_warn(server, "fovea-web: ");
    if (!fv_web_server_run(server))
        status = fovea_error_set(error, FOVEA_ERROR_SYSTEM, "the server failed");
    atomic_store(&served, NULL);
    fv_web_server_close(server);
    fv_web_calibration_end(&web->calibration);
    return status;
}

/* One more, with its store. NULL: no memory. */
static struct fv_web_relay *robot_add(struct web *web, const char *name, const char *path)
{
    struct fv_web_store *store = calloc(1, sizeof *store);
    struct fv_web_relay *relay = calloc(1, sizeof *relay);
    if (store == NULL || relay == NULL || !fv_web_robots_add(&web->robots, relay, name)) {
        free(store);
        free(relay);
        return NULL;
    }
    fv_web_relay_init(relay, path, (uint32_t)web->rate, store);
    return relay;
}

static enum fovea_status robots_open(struct web *web, struct fv_web_player *player,
                                     struct fovea_error *error)
{
    enum fovea_status status = FOVEA_OK;
    struct fv_web_relay *relay = NULL;
    bool all = true;
    if (player != NULL) {
        relay = robot_add(web, web->play, "");
        all = relay != NULL;
        if (all) fv_web_relay_play(relay, player);
    }
    for (int i = 0; i < web->feeds.count && all; i++)
        all = robot_add(web, web->feeds.values[i], web->feeds.values[i]) != NULL;
    for (int i = 0; i < web->prefixes.count && all && status == FOVEA_OK; i++) {
        relay = robot_add(web, web->prefixes.values[i], "");
        all = relay != NULL;
        if (!all) break;
        fv_web_relay_hear(relay, &web->heard[i]);
        status = fv_web_heard_open(&web->heard[i], relay, web->lcm,
                                   web->listen != NULL ? web->listen : "any",
                                   web->prefixes.values[i], error);
    }
    return all ? status : fovea_error_set(error, FOVEA_ERROR_MEMORY, "no memory");
}

static void robots_close(struct web *web)
{
    for (int i = 0; i < web->prefixes.count; i++)
        fv_web_heard_close(&web->heard[i]);
    for (uint32_t i = 0; i < web->robots.count; i++) {
        struct fv_web_relay *relay = web->robots.robots[i].relay;
        fv_web_relay_close(relay);
        fv_web_store_free(relay->store);
        free(relay->store);
        free(relay);
    }
}

/* The page shows all that the feed has without LCM, too: it sends no commands then. */
static enum fovea_status commander_open(struct web *web, struct fovea_error *error)
{
    if (web->feeds.count == 0) return FOVEA_OK;
    const enum fovea_status status =
        fv_web_commander_open(&web->commander, web->url, web->key, error);
    if (status != FOVEA_ERROR_SYSTEM) return status;
    fv_say("fovea-web: the page sends no commands until it is started again: %s", error->text);
    return FOVEA_OK;
}

static enum fovea_status run(struct web *web, struct fovea_error *error)
{
    struct fv_web_player *player = NULL;
    enum fovea_status status = options_check(web, error);
    if (status == FOVEA_OK) status = tokens_open(web, error);
    if (status == FOVEA_OK) status = certificate_open(web, error);
    fv_message_prepare();
    if (status == FOVEA_OK && web->play != NULL) {
        struct fovea_error damage;
        status = fv_web_player_open(web->play, &player, &damage, error);
        if (status == FOVEA_OK && damage.text[0] != '\0')
            fv_say("fovea-web: %s; it is played up to there", damage.text);
        if (status == FOVEA_ERROR_UNSUPPORTED) status = FOVEA_ERROR_INPUT;
    }
    if (status == FOVEA_OK) status = commander_open(web, error);
    if (status == FOVEA_OK) status = robots_open(web, player, error);
    if (status == FOVEA_OK) status = serve(web, error);
    robots_close(web);
    fv_web_commander_close(&web->commander);
    fv_web_player_close(player);
    return status;
}

int main(int argc, char **argv)
{
    static struct web web = {.address = "127.0.0.1", .port = PORT_DEFAULT, .rate = RATE_DEFAULT};
    struct sigaction action = {.sa_handler = on_end};
    struct fovea_error error;
    if (argc == 2 && strcmp(argv[1], "--version") == 0) {
        printf("fovea-web %s\n", FOVEA_VERSION);
        return fv_say_unwritten();
    }
    const enum fv_options_result result = options_read(&web, argc, argv);
    if (result == FV_OPTIONS_HELP) return fv_say_unwritten();
    if (result != FV_OPTIONS_READ) return FV_EXIT_WRONG;
    if (web.with_parent != 0) {
        prctl(PR_SET_PDEATHSIG, SIGTERM);
        if ((uint64_t)getppid() != web.with_parent) return FV_EXIT_OK; /* it has ended already */
    }
    sigemptyset(&action.sa_mask);
    sigaction(SIGINT, &action, NULL);
    sigaction(SIGTERM, &action, NULL);
    signal(SIGPIPE, SIG_IGN);
    const enum fovea_status status = run(&web, &error);
    if (status == FOVEA_OK) return FV_EXIT_OK;
    return status == FOVEA_ERROR_INPUT ? fv_say_wrong("fovea-web: %s", error.text)
                                       : fv_say_failed("fovea-web: %s", error.text);
}

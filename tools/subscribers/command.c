/* Send a command to a run of Fovea, with the proof that a key asks for, and wait for its answer. An
 * example for programs in C; command.py does the same and also hears the number of the run (run_id
 * of FOVEA_RUN).
 *
 *     build/command [--prefix FOVEA] [--ttl 0] [--wait 3] [--key FILE --run-id N [--sender N]] save
 *
 * A command and its answer are one UDP packet each: "LC02", a number of 4 bytes, the channel with
 * its zero, and the encoded message. So no LCM library is needed. The line on standard output is
 * the answer: exit 0 if the command is done, 1 if it was refused or failed, 3 without an answer. */
#include <arpa/inet.h>
#include <inttypes.h>
#include <netinet/in.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <time.h>
#include <unistd.h>

#include "app/network/command_gate.h"

#include "fovea_command_result_t.h"
#include "fovea_command_t.h"

#define GROUP "239.255.76.67"
enum { PORT = 7667, PACKET_BYTES = 512, EXIT_NOT_DONE = 1, EXIT_NO_ANSWER = 3 };

struct options {
    const char *prefix, *key;
    int ttl, wait_s; /* 0: do not wait */
    fovea_command_t command;
};

struct answer {
    char text[400];
    int end;    /* exit status */
    bool meant; /* of the run that the command is for */
};

static int usage(void)
{
    fprintf(stderr, "usage: command [--prefix FOVEA] [--ttl 0] [--wait 3] [--key FILE --run-id N] "
                    "[--sender N] "
                    "reset|pause|resume|save|overwrite|record|record-stop ...\n");
    return 2;
}

static bool take_word(struct options *options, const char *word)
{
    static const char *const words[] = {"reset",     "pause",  "resume",     "save",
                                        "overwrite", "record", "record-stop"};
    for (int i = 0; i < (int)(sizeof words / sizeof words[0]); i++)
        if (strcmp(word, words[i]) == 0) {
            options->command.commands |= 1 << i;
            return true;
        }
    return false;
}

static bool read_options(int argc, char **argv, struct options *options)
{
    for (int i = 1; i < argc; i++) {
        const char *value = i + 1 < argc ? argv[i + 1] : NULL;
        if (take_word(options, argv[i])) continue;
        if (value == NULL) return false;
        if (strcmp(argv[i], "--prefix") == 0)
            options->prefix = value;
        else if (strcmp(argv[i], "--key") == 0)
            options->key = value;
        else if (strcmp(argv[i], "--ttl") == 0)
            options->ttl = (int)strtol(value, NULL, 10);
        else if (strcmp(argv[i], "--wait") == 0)
            options->wait_s = (int)strtol(value, NULL, 10);
        else if (strcmp(argv[i], "--run-id") == 0)
            options->command.run_id = strtoll(value, NULL, 10);
        else if (strcmp(argv[i], "--sender") == 0)
            options->command.sender = strtoll(value, NULL, 10);
        else
            return false;
        i++;
    }
    return options->command.commands != 0 && (options->key == NULL || options->command.run_id != 0);
}

/* The message is encoded with mac 0, and then with the code of these bytes. */
static int encode(struct options *options, uint8_t data[256], struct fovea_error *error)
{
    uint8_t key[FV_SIPHASH_KEY_BYTES];
    options->command.mac = 0;
    int bytes = fovea_command_t_encode(data, 0, 256, &options->command);
    if (options->key == NULL || bytes < 0) return bytes;
    if (fv_command_key_read(options->key, key, error) != FOVEA_OK) return -1;
    options->command.mac = (int64_t)fv_siphash(key, data, (size_t)bytes, 0);
    return fovea_command_t_encode(data, 0, 256, &options->command);
}

static int64_t now_ns(clockid_t clock)
{
    struct timespec now;
    clock_gettime(clock, &now);
    return now.tv_sec * INT64_C(1000000000) + now.tv_nsec;
}

/* A socket that hears what is sent to the group; -1: there is none. */
static int listen_open(void)
{
    const int hearing = socket(AF_INET, SOCK_DGRAM, 0), one = 1;
    const struct sockaddr_in group = {
        .sin_family = AF_INET, .sin_port = htons(PORT), .sin_addr.s_addr = inet_addr(GROUP)};
    const struct ip_mreq member = {.imr_multiaddr.s_addr = inet_addr(GROUP)};
    if (hearing >= 0 && setsockopt(hearing, SOL_SOCKET, SO_REUSEADDR, &one, sizeof one) == 0 &&
        bind(hearing, (const struct sockaddr *)&group, sizeof group) == 0 &&
        setsockopt(hearing, IPPROTO_IP, IP_ADD_MEMBERSHIP, &member, sizeof member) == 0)
        return hearing;
    if (hearing >= 0) close(hearing);
    return -1;
}

static bool command_send(const struct options *options, const uint8_t *message, int bytes)
{
    uint8_t packet[PACKET_BYTES] = {'L', 'C', '0', '2'};
    const struct sockaddr_in to = {
        .sin_family = AF_INET, .sin_port = htons(PORT), .sin_addr.s_addr = inet_addr(GROUP)};
    const int name = sprintf((char *)packet + 8, "%s_COMMAND", options->prefix) + 1;
    memcpy(packet + 8 + name, message, (size_t)bytes);
    const size_t all = 8 + (size_t)(name + bytes);
    const int udp = socket(AF_INET, SOCK_DGRAM, 0);
    const bool sent =
        udp >= 0 &&
        setsockopt(udp, IPPROTO_IP, IP_MULTICAST_TTL, &options->ttl, sizeof options->ttl) == 0 &&
        sendto(udp, packet, all, 0, (const struct sockaddr *)&to, sizeof to) == (ssize_t)all;
    if (udp >= 0) close(udp);
    return sent;
}

/* The answer to our command, of whichever run, as a line; false: the packet is none. */
static bool answer_read(const struct options *options, const uint8_t *packet, ssize_t bytes,
                        struct answer *answer)
{
    static const char *const words[] = {"done", "refused", "failed"};
    char name[64];
    const ssize_t head = 8 + sprintf(name, "%s_COMMAND_RESULT", options->prefix) + 1;
    fovea_command_result_t result;
    if (bytes < head || memcmp(packet, "LC02", 4) != 0 ||
        memcmp(packet + 8, name, (size_t)head - 8) != 0 ||
        fovea_command_result_t_decode(packet, (int)head, (int)(bytes - head), &result) < 0)
        return false;
    const bool ours = result.id == options->command.id && result.sender == options->command.sender;
    if (ours) {
        const char *word = result.result >= 0 && result.result < 3 ? words[result.result] : "?";
        snprintf(answer->text, sizeof answer->text, "%s%s%s", word,
                 result.reason[0] != '\0' ? ": " : "", result.reason);
        answer->end = result.result == FOVEA_COMMAND_RESULT_T_RESULT_DONE ? 0 : EXIT_NOT_DONE;
        answer->meant = options->command.run_id == 0 || result.run_id == options->command.run_id;
    }
    fovea_command_result_t_decode_cleanup(&result);
    return ours;
}

/* The answer of the run that is meant; where that is silent, what another one says. */
static int answer_wait(const struct options *options, int hearing)
{
    uint8_t packet[PACKET_BYTES];
    const int64_t until = now_ns(CLOCK_MONOTONIC) + options->wait_s * INT64_C(1000000000);
    struct answer answer = {.end = EXIT_NO_ANSWER};
    snprintf(answer.text, sizeof answer.text, "no answer on %s_COMMAND_RESULT within %d s",
             options->prefix, options->wait_s);
    for (int64_t left; !answer.meant && (left = until - now_ns(CLOCK_MONOTONIC)) > 0;) {
        const struct timeval most = {left / 1000000000, left % 1000000000 / 1000 + 1};
        setsockopt(hearing, SOL_SOCKET, SO_RCVTIMEO, &most, sizeof most);
        const ssize_t bytes = recv(hearing, packet, sizeof packet, 0);
        if (bytes > 0) (void)answer_read(options, packet, bytes, &answer);
    }
    puts(answer.text);
    return answer.end;
}

int main(int argc, char **argv)
{
    struct options options = {.prefix = "FOVEA", .wait_s = 3, .command.sender = 1};
    struct fovea_error error = {0};
    uint8_t message[256];
    if (!read_options(argc, argv, &options) || strlen(options.prefix) > 40) return usage();
    options.command.counter = now_ns(CLOCK_REALTIME); /* it must rise */
    options.command.id = options.command.counter;
    options.command.utime = options.command.counter / 1000;
    const int bytes = encode(&options, message, &error);
    if (bytes < 0) return fprintf(stderr, "command: %s\n", error.text), 1;
    const int hearing = options.wait_s > 0 ? listen_open() : -1; /* before the answer can come */
    if ((options.wait_s > 0 && hearing < 0) || !command_send(&options, message, bytes))
        return perror("command"), 1;
    return hearing >= 0 ? answer_wait(&options, hearing) : 0;
}

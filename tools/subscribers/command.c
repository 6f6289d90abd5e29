/* Send a command to a run of Fovea, with the proof that a key asks for. An example for programs in
 * C; command.py does the same and also hears the number of the run (run_id of FOVEA_RUN).
 *
 *     build/command [--prefix FOVEA] [--ttl 0] [--key FILE --run-id N [--sender N]] save ...
 *
 * A command is one UDP packet: "LC02", a number of 4 bytes, the channel with its zero, and the
 * encoded message. So no LCM library is needed. */
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

#include "fovea_command_t.h"

struct options {
    const char *prefix, *key;
    int ttl;
    fovea_command_t command;
};

static int usage(void)
{
    fprintf(stderr,
            "usage: command [--prefix FOVEA] [--ttl 0] [--key FILE --run-id N] [--sender N] "
            "reset|pause|resume|save|overwrite ...\n");
    return 2;
}

static bool take_word(struct options *options, const char *word)
{
    static const char *const words[] = {"reset", "pause", "resume", "save", "overwrite"};
    for (int i = 0; i < 5; i++)
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
            options->ttl = atoi(value);
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
    options->command.mac = (int64_t)fv_siphash(key, data, (size_t)bytes);
    return fovea_command_t_encode(data, 0, 256, &options->command);
}

int main(int argc, char **argv)
{
    struct options options = {.prefix = "FOVEA", .command.sender = 1};
    struct fovea_error error = {0};
    struct timespec now;
    uint8_t packet[512] = {'L', 'C', '0', '2'};
    const struct sockaddr_in to = {.sin_family = AF_INET,
                                   .sin_port = htons(7667),
                                   .sin_addr.s_addr = inet_addr("239.255.76.67")};
    if (!read_options(argc, argv, &options) || strlen(options.prefix) > 40) return usage();
    clock_gettime(CLOCK_REALTIME, &now);
    options.command.counter = now.tv_sec * INT64_C(1000000000) + now.tv_nsec; /* it must rise */
    options.command.id = options.command.counter;
    options.command.utime = options.command.counter / 1000;
    const int name = sprintf((char *)packet + 8, "%s_COMMAND", options.prefix) + 1;
    const int bytes = encode(&options, packet + 8 + name, &error);
    if (bytes < 0) return fprintf(stderr, "command: %s\n", error.text), 1;
    const int udp = socket(AF_INET, SOCK_DGRAM, 0);
    const size_t all = 8 + (size_t)(name + bytes);
    if (udp < 0 ||
        setsockopt(udp, IPPROTO_IP, IP_MULTICAST_TTL, &options.ttl, sizeof options.ttl) != 0 ||
        sendto(udp, packet, all, 0, (const struct sockaddr *)&to, sizeof to) != (ssize_t)all)
        return perror("command"), 1;
    close(udp);
    return 0;
}

/* fovea-web as a child of the test, and requests to it over raw sockets. */
#ifndef FOVEA_TESTS_WEB_CLIENT_H
#define FOVEA_TESTS_WEB_CLIENT_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <sys/types.h>

enum { WEB_PORT = 7680, WEB_ANSWER_BYTES = 1 << 17 };

/* Whether fovea-web was built, beside the test's folder; a line with SKIPPED if not. */
bool web_possible(const char *test);
/* Start it at WEB_PORT of 127.0.0.1, and wait until it listens. */
pid_t web_start(const char *const *arguments);
/* Its exit status, after it was told to end if `end`; -1 after a signal. */
int web_end(pid_t process, bool end);

/* A connection; patience of 20 s for each reading. */
int web_connect(void);
bool web_send(int socket, const char *text);
/* Send a request of HTTP/1.1 and read what is answered until the length that it states, or the end.
 * Returns the status; 0: closed without an answer. */
int web_ask(const char *request, char answer[WEB_ANSWER_BYTES]);
/* GET of a path with these further headers, each with its end of line. */
int web_get(const char *path, const char *headers, char answer[WEB_ANSWER_BYTES]);

/* Open a websocket. Returns the status, 101: it is open at `*socket`. */
int web_open(const char *origin, const char *headers, int *socket);
/* The same of another protocol and path; `headers` as above. */
int web_open_protocol(const char *protocol, const char *path, const char *headers, int *socket);
/* One frame of text, masked. */
bool web_say(int socket, const char *text);
/* One frame that begins with this byte (0x81: text, 0x82: bytes, 0x01 and 0x80: its pieces). */
bool web_say_frame(int socket, uint8_t first, const void *data, size_t bytes);
/* The next frame: its opcode; -1: closed, or longer than `capacity`. */
int web_hear(int socket, uint8_t *data, size_t capacity, size_t *bytes);

#endif

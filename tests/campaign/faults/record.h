/* What a campaign has done, kept between its runs: files of lines, appended one by one, the first
 * of which names the program that made them. The lines of another program are of no use: such a
 * file is moved to PATH.before, with a line on stdout. A last line that was torn by an end in the
 * middle is taken off. Errors of the file system end the process with a line. */
#ifndef FOVEA_TESTS_CAMPAIGN_FAULTS_RECORD_H
#define FOVEA_TESTS_CAMPAIGN_FAULTS_RECORD_H

#include <stdio.h>

#include "report.h"

/* A source without faults; with wheel odometry or without it, which are two. */
struct faults_bare {
    char source[FAULTS_TEXT];
    bool wheels;
    struct faults_verdict verdict;
};

enum { FAULTS_LINE = FAULTS_TEXT + 512 };

/* Hash of the running program. */
uint64_t faults_build(void);

/* Behind the first line of a file of the program `build`; NULL: there is none. */
FILE *faults_record_open(const char *path, uint64_t build);
/* The next line, without its end; false: there is none. */
bool faults_record_next(FILE *file, char line[FAULTS_LINE]);
void faults_record_append(const char *path, uint64_t build, const char *line);

/* A line for each; reading is false where it is not such a line. */
void faults_result_write(const struct faults_result *result, char line[FAULTS_LINE]);
bool faults_result_read(const char *line, struct faults_result *result);
void faults_bare_write(const struct faults_bare *bare, char line[FAULTS_LINE]);
bool faults_bare_read(const char *line, struct faults_bare *bare);

#endif

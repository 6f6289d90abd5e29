#include "record.h"

#include <inttypes.h>
#include <string.h>
#include <unistd.h>

#include "base/hash.h"

uint64_t faults_build(void)
{
    static uint8_t piece[1 << 16];
    uint64_t hash = FV_HASH_START;
    FILE *file = fopen("/proc/self/exe", "rb");
    if (file == NULL) faults_die("/proc/self/exe cannot be read");
    for (size_t bytes; (bytes = fread(piece, 1, sizeof piece, file)) > 0;)
        hash = fv_hash(hash, piece, bytes);
    fclose(file);
    return hash;
}

/* ---- files ----------------------------------------------------------------------------------- */

static void first_line(uint64_t build, char line[64])
{
    (void)snprintf(line, 64, "build %016" PRIx64 "\n", build);
}

/* Take off what is behind the last end of a line. */
static void mend(const char *path)
{
    FILE *file = fopen(path, "r");
    long whole = 0;
    int c;
    if (file == NULL) return;
    while ((c = fgetc(file)) != EOF)
        if (c == '\n') whole = ftell(file);
    fclose(file);
    if (truncate(path, whole)) faults_die("the record cannot be written");
}

FILE *faults_record_open(const char *path, uint64_t build)
{
    char expected[64], found[64], before[FAULTS_TEXT + 8];
    mend(path);
    FILE *file = fopen(path, "r");
    if (file == NULL) return NULL;
    first_line(build, expected);
    if (fgets(found, sizeof found, file) != NULL && strcmp(found, expected) == 0) return file;
    fclose(file);
    (void)snprintf(before, sizeof before, "%s.before", path);
    if (rename(path, before)) faults_die("the record cannot be moved");
    printf("%s is of another build: moved to %s\n", path, before);
    return NULL;
}

bool faults_record_next(FILE *file, char line[FAULTS_LINE])
{
    if (fgets(line, FAULTS_LINE, file) == NULL) return false;
    line[strcspn(line, "\n")] = '\0';
    return true;
}

void faults_record_append(const char *path, uint64_t build, const char *line)
{
    char first[64];
    FILE *file = fopen(path, "a");
    if (file == NULL || fseek(file, 0, SEEK_END)) faults_die("the record cannot be written");
    first_line(build, first);
    if (ftell(file) == 0) fputs(first, file);
    fprintf(file, "%s\n", line);
    if (fclose(file)) faults_die("the record cannot be written");
}

/* ---- lines ----------------------------------------------------------------------------------- */

void faults_result_write(const struct faults_result *r, char line[FAULTS_LINE])
{
    const struct faults_verdict *v = &r->verdict;
    (void)snprintf(line, FAULTS_LINE,
                   "%" PRIu64 " %u %u %u %u %u %d %" PRIu64
                   " %u %u %u %u %u %u %u %.9g %.9g %u %u %.9g",
                   r->seed, r->kind, r->end, r->bare, r->map, r->endless, r->descriptors,
                   r->heap_calls, v->given, v->processed, v->posed, v->tracking, v->due, v->judged,
                   v->wrong, v->worst, v->error_m, v->returns, v->late, v->last_s);
}

bool faults_result_read(const char *line, struct faults_result *r)
{
    struct faults_verdict *v = &r->verdict;
    int end = -1;
    return sscanf(line,
                  "%" SCNu64 " %u %u %u %u %u %d %" SCNu64
                  " %u %u %u %u %u %u %u %lf %lf %u %u %lf%n",
                  &r->seed, &r->kind, &r->end, &r->bare, &r->map, &r->endless, &r->descriptors,
                  &r->heap_calls, &v->given, &v->processed, &v->posed, &v->tracking, &v->due,
                  &v->judged, &v->wrong, &v->worst, &v->error_m, &v->returns, &v->late, &v->last_s,
                  &end) == 20 &&
           line[end] == '\0' && r->kind < FAULTS_KINDS && r->end <= FAULTS_HANG &&
           r->map <= FAULTS_MAP_USELESS;
}

void faults_bare_write(const struct faults_bare *bare, char line[FAULTS_LINE])
{
    const struct faults_verdict *v = &bare->verdict;
    (void)snprintf(line, FAULTS_LINE, "%u %u %u %u %u %.9g %s %s", v->given, v->tracking, v->due,
                   v->judged, v->wrong, v->worst, bare->wheels ? "wheels" : "free", bare->source);
}

bool faults_bare_read(const char *line, struct faults_bare *bare)
{
    struct faults_verdict *v = &bare->verdict;
    char scale[8];
    memset(bare, 0, sizeof *bare);
    if (sscanf(line, "%u %u %u %u %u %lf %7s %1023[^\n]", &v->given, &v->tracking, &v->due,
               &v->judged, &v->wrong, &v->worst, scale, bare->source) != 8)
        return false;
    bare->wheels = strcmp(scale, "wheels") == 0;
    return bare->wheels || strcmp(scale, "free") == 0;
}

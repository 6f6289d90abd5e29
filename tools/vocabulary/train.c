/* Train the visual vocabulary (src/map/vocabulary.h) from pictures and sources.
 *
 * train SEED OUTPUT LIST: every line of LIST is a picture's path, or a source's URI, a blank and
 * every how many frames one is taken. Descriptors are those of the runtime's own extractor. Each
 * node's descriptors are split by k-medians under the Hamming distance: centres drawn far apart
 * (k-means++), then bitwise majorities, until nothing changes or ROUNDS_MAX. A node with fewer
 * different descriptors than children repeats its first centre, which no descriptor then chooses.
 * The same list and seed give the same file. */
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "app/lab/extract.h"
#include "base/elementary.h"
#include "drivers/table.h"
#include "fovea/source.h"
#include "map/vocabulary.h"

enum { FEATURES = 1000, ROUNDS_MAX = 12, BITS = 256 };

typedef uint64_t descriptor[4];

struct set {
    descriptor *all;
    uint32_t *image; /* of each descriptor */
    uint32_t count, capacity, images;
    struct fv_random random;
    uint8_t *file;
};

static void die(const char *text)
{
    fprintf(stderr, "train: %s\n", text);
    exit(1);
}

static uint32_t distance(const descriptor a, const descriptor b)
{
    uint32_t sum = 0;
    for (int k = 0; k < 4; k++)
        sum += (uint32_t)__builtin_popcountll(a[k] ^ b[k]);
    return sum;
}

/* ---- descriptors ----------------------------------------------------------------------------- */

static void take(struct set *set, const struct fv_extract *extract)
{
    const uint32_t count = extract->found.count;
    if (set->count + count > set->capacity) {
        set->capacity = 2 * set->capacity + count;
        set->all = realloc(set->all, set->capacity * sizeof *set->all);
        set->image = realloc(set->image, set->capacity * sizeof *set->image);
        if (set->all == NULL || set->image == NULL) die("out of memory");
    }
    memcpy(set->all[set->count], extract->found.descriptors, (size_t)count * FV_DESCRIPTOR_BYTES);
    for (uint32_t i = 0; i < count; i++)
        set->image[set->count + i] = set->images;
    set->count += count;
    set->images++;
}

static void take_picture(struct set *set, const char *path,
                         const struct fovea_extract_config *config)
{
    struct fovea_error error;
    struct fv_extract extract;
    if (fv_extract(path, NULL, config, &extract, &error) != FOVEA_OK)
        fprintf(stderr, "left out: %s\n", error.text); /* too small, or a format that is not read */
    else
        take(set, &extract);
    fv_extract_free(&extract);
}

static void take_frames(struct set *set, const char *uri, uint64_t step,
                        const struct fovea_extract_config *config)
{
    const struct fovea_source_ops *ops;
    const char *address;
    struct fovea_source *source;
    struct fovea_error error;
    struct fovea_frame frame;
    const struct fovea_source_selection selection = {.step = step};
    if (fv_source_find(uri, &ops, &address, &error) != FOVEA_OK ||
        ops->open(address, &selection, &source, &error) != FOVEA_OK ||
        ops->start(source, &error) != FOVEA_OK)
        die(error.text);
    while (ops->dequeue(source, INT64_MAX, &frame) == FOVEA_OK) {
        struct fv_extract extract;
        if (fv_extract_image(&frame.images[0], NULL, config, &extract, &error) != FOVEA_OK)
            die(error.text);
        take(set, &extract);
        fv_extract_free(&extract);
        ops->requeue(source, &frame);
    }
    ops->stop(source);
    ops->close(source);
}

static void read_list(struct set *set, const char *path)
{
    struct fovea_extract_config config;
    struct fovea_error error;
    if (fv_extract_config(NULL, NULL, FEATURES, &config, &error) != FOVEA_OK) die(error.text);
    FILE *list = fopen(path, "r");
    if (list == NULL) die("no list");
    char line[4096], uri[4096];
    while (fgets(line, sizeof line, list) != NULL) {
        uint64_t step;
        line[strcspn(line, "\n")] = 0;
        if (line[0] == 0) continue;
        if (sscanf(line, "%4095s %" SCNu64, uri, &step) == 2)
            take_frames(set, uri, step, &config);
        else
            take_picture(set, line, &config);
    }
    fclose(list);
}

/* ---- the tree -------------------------------------------------------------------------------- */

/* Centres far apart: each next one with a probability that grows with the square of the distance to
 * the nearest. */
static uint32_t choose_centres(struct set *set, const uint32_t *member, uint32_t count,
                               descriptor *centre)
{
    uint32_t *nearest = malloc(count * sizeof *nearest), chosen = 0;
    if (nearest == NULL) die("out of memory");
    memcpy(centre[chosen++], set->all[member[fv_random_below(&set->random, count)]],
           sizeof *centre);
    for (uint32_t i = 0; i < count; i++)
        nearest[i] = BITS;
    while (chosen < FV_VOCABULARY_BRANCH) {
        double sum = 0;
        for (uint32_t i = 0; i < count; i++) {
            const uint32_t d = distance(set->all[member[i]], centre[chosen - 1]);
            if (d < nearest[i]) nearest[i] = d;
            sum += (double)nearest[i] * nearest[i];
        }
        if (sum <= 0) break;
        double draw = sum * fv_random_unit(&set->random);
        uint32_t pick = 0;
        for (uint32_t i = 0; i < count; i++) {
            if (nearest[i] == 0) continue;
            pick = i;
            draw -= (double)nearest[i] * nearest[i];
            if (draw < 0) break;
        }
        memcpy(centre[chosen++], set->all[member[pick]], sizeof *centre);
    }
    free(nearest);
    return chosen;
}

static bool assign(const struct set *set, const uint32_t *member, uint32_t count,
                   descriptor *centre, uint8_t *cluster)
{
    bool changed = false;
    for (uint32_t i = 0; i < count; i++) {
        uint32_t best = 0, least = BITS + 1;
        for (uint32_t k = 0; k < FV_VOCABULARY_BRANCH; k++) {
            const uint32_t d = distance(set->all[member[i]], centre[k]);
            if (d < least) {
                least = d;
                best = k;
            }
        }
        changed = changed || cluster[i] != best;
        cluster[i] = (uint8_t)best;
    }
    return changed;
}

/* Each centre becomes the bitwise majority of its members; an empty one stays. */
static void move_centres(const struct set *set, const uint32_t *member, uint32_t count,
                         const uint8_t *cluster, descriptor *centre)
{
    static uint32_t ones[FV_VOCABULARY_BRANCH][BITS], size[FV_VOCABULARY_BRANCH];
    memset(ones, 0, sizeof ones);
    memset(size, 0, sizeof size);
    for (uint32_t i = 0; i < count; i++) {
        size[cluster[i]]++;
        for (int b = 0; b < BITS; b++)
            ones[cluster[i]][b] += set->all[member[i]][b / 64] >> (b % 64) & 1;
    }
    for (int k = 0; k < FV_VOCABULARY_BRANCH; k++) {
        if (size[k] == 0) continue;
        memset(centre[k], 0, sizeof *centre);
        for (int b = 0; b < BITS; b++)
            if (2 * ones[k][b] > size[k]) centre[k][b / 64] |= UINT64_C(1) << (b % 64);
    }
}

/* Split members of node `node` of `depth`, and go on into each part. `first`: bytes before this
 * level's centres. */
static void split(struct set *set, uint32_t *member, uint32_t count, int depth, uint32_t node,
                  size_t first, uint32_t nodes)
{
    if (depth == FV_VOCABULARY_DEPTH) return;
    descriptor centre[FV_VOCABULARY_BRANCH];
    uint8_t *cluster = calloc(count + 1, 1);
    uint32_t *sorted = malloc((count + 1) * sizeof *sorted);
    if (cluster == NULL || sorted == NULL) die("out of memory");
    memset(centre, 0, sizeof centre);
    if (count > 0) {
        const uint32_t chosen = choose_centres(set, member, count, centre);
        for (uint32_t k = chosen; k < FV_VOCABULARY_BRANCH; k++)
            memcpy(centre[k], centre[0], sizeof *centre);
        (void)assign(set, member, count, centre, cluster);
        for (int round = 0; round < ROUNDS_MAX; round++) {
            move_centres(set, member, count, cluster, centre);
            if (!assign(set, member, count, centre, cluster)) break;
        }
    }
    memcpy(set->file + first + (size_t)node * sizeof centre, centre, sizeof centre);
    uint32_t start[FV_VOCABULARY_BRANCH + 1] = {0};
    for (uint32_t i = 0; i < count; i++)
        start[cluster[i] + 1]++;
    for (int k = 0; k < FV_VOCABULARY_BRANCH; k++)
        start[k + 1] += start[k];
    uint32_t at[FV_VOCABULARY_BRANCH];
    memcpy(at, start, sizeof at);
    for (uint32_t i = 0; i < count; i++)
        sorted[at[cluster[i]]++] = member[i];
    memcpy(member, sorted, count * sizeof *member);
    free(cluster);
    free(sorted);
    nodes *= FV_VOCABULARY_BRANCH;
    for (uint32_t k = 0; k < FV_VOCABULARY_BRANCH; k++)
        split(set, member + start[k], start[k + 1] - start[k], depth + 1,
              node * FV_VOCABULARY_BRANCH + k, first + (size_t)nodes * FV_DESCRIPTOR_BYTES, nodes);
}

/* Word of a descriptor in the new tree. */
static uint32_t word_of(const struct set *set, const descriptor d)
{
    uint32_t node = 0, nodes = 1;
    size_t first = 0;
    for (int depth = 0; depth < FV_VOCABULARY_DEPTH; depth++) {
        uint32_t best = 0, least = BITS + 1;
        for (uint32_t k = 0; k < FV_VOCABULARY_BRANCH; k++) {
            descriptor centre;
            memcpy(centre,
                   set->file + first + ((size_t)node * FV_VOCABULARY_BRANCH + k) * sizeof centre,
                   sizeof centre);
            const uint32_t away = distance(d, centre);
            if (away < least) {
                least = away;
                best = k;
            }
        }
        nodes *= FV_VOCABULARY_BRANCH;
        node = node * FV_VOCABULARY_BRANCH + best;
        first += (size_t)nodes * FV_DESCRIPTOR_BYTES;
    }
    return node;
}

/* Weight of each word: log(images / images with it), squared; a word that no image has counts as in
 * one image. */
static void weigh(struct set *set)
{
    uint32_t *images = calloc(FV_VOCABULARY_WORDS, sizeof *images),
             *last = calloc(FV_VOCABULARY_WORDS, sizeof *last);
    if (images == NULL || last == NULL) die("out of memory");
    for (uint32_t i = 0; i < set->count; i++) {
        const uint32_t word = word_of(set, set->all[i]);
        if (last[word] != set->image[i] + 1) images[word]++;
        last[word] = set->image[i] + 1;
    }
    uint32_t used = 0;
    for (uint32_t w = 0; w < FV_VOCABULARY_WORDS; w++) {
        const double idf = fv_log((double)set->images / (images[w] > 0 ? images[w] : 1));
        const uint32_t weight = (uint32_t)(FV_VOCABULARY_WEIGHT_ONE * idf * idf + 0.5);
        uint8_t *at =
            set->file + (size_t)FV_VOCABULARY_CENTRES * FV_DESCRIPTOR_BYTES + 2 * (size_t)w;
        at[0] = (uint8_t)(weight & 0xff);
        at[1] = (uint8_t)(weight >> 8);
        used += images[w] > 0;
    }
    printf("%u images, %u descriptors, %u of %d words used\n", set->images, set->count, used,
           FV_VOCABULARY_WORDS);
    free(images);
    free(last);
}

int main(int argc, char **argv)
{
    if (argc != 4) die("usage: train SEED OUTPUT LIST");
    struct set set = {.file = calloc(1, FV_VOCABULARY_BYTES)};
    fv_random_seed(&set.random, strtoull(argv[1], NULL, 10));
    read_list(&set, argv[3]);
    if (set.file == NULL || set.count < FV_VOCABULARY_WORDS) die("too few descriptors");
    uint32_t *member = malloc(set.count * sizeof *member);
    if (member == NULL) die("out of memory");
    for (uint32_t i = 0; i < set.count; i++)
        member[i] = i;
    split(&set, member, set.count, 0, 0, 0, 1);
    weigh(&set);
    FILE *file = fopen(argv[2], "wb");
    if (file == NULL || fwrite(set.file, FV_VOCABULARY_BYTES, 1, file) != 1 || fclose(file) != 0)
        die("cannot write");
    free(member);
    free(set.all);
    free(set.image);
    free(set.file);
    return 0;
}

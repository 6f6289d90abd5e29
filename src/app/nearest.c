#include "app/nearest.h"

#include <ctype.h>
#include <string.h>

enum { LENGTH_MAX = 63 };

static int smaller(int a, int b)
{
    return a < b ? a : b;
}

int fv_edit_distance(const char *a, const char *b)
{
    int rows[3][LENGTH_MAX + 1];
    int length_a = (int)strnlen(a, LENGTH_MAX), length_b = (int)strnlen(b, LENGTH_MAX);
    int *before = rows[0], *last = rows[1], *row = rows[2];
    for (int j = 0; j <= length_b; j++) {
        before[j] = 0;
        last[j] = j;
    }
    for (int i = 1; i <= length_a; i++) {
        int ca = tolower((unsigned char)a[i - 1]);
        row[0] = i;
        for (int j = 1; j <= length_b; j++) {
            int cb = tolower((unsigned char)b[j - 1]);
            row[j] = smaller(smaller(last[j], row[j - 1]) + 1, last[j - 1] + (ca != cb));
            if (i > 1 && j > 1 && ca == tolower((unsigned char)b[j - 2]) &&
                cb == tolower((unsigned char)a[i - 2]))
                row[j] = smaller(row[j], before[j - 2] + 1);
        }
        int *oldest = before;
        before = last;
        last = row;
        row = oldest;
    }
    return last[length_b];
}

void fv_nearest_offer(struct fv_nearest *nearest, const char *known)
{
    int distance = fv_edit_distance(nearest->wanted, known);
    size_t longer = strlen(nearest->wanted) > strlen(known) ? strlen(nearest->wanted) : strlen(known);
    if ((size_t)distance * 2 > longer || (nearest->name != NULL && distance >= nearest->distance)) return;
    nearest->name = known;
    nearest->distance = distance;
}

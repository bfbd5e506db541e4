/* port REQUESTS OUTPUTS: answers every case of REQUESTS/requests.json whose operation stands in the table below, and
 * writes the operations that it does not know to OUTPUTS/not_ported.txt.
 */
#define _POSIX_C_SOURCE 200809L /* mkdir */
#include "port.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#ifdef _WIN32
#include <direct.h>
#define mkdir(path, mode) _mkdir(path)
#else
#include <sys/stat.h>
#endif

static const struct {
    const char *name;
    Operation *run;
} OPERATIONS[] = {
    {"reading", reading},       {"generator", generator},   {"frequencies", frequencies}, {"dictionary", dictionary},
    {"atoms", atoms},           {"appearance", appearance}, {"motion", motion},           {"matern", matern},
    {"laplacian", laplacian},   {"calibration", calibration}, {"deformation", deformation},
    {"covariance", covariance}, {"projection", projection}, {"harmonics", harmonics},     {"composite", composite},
    {"masked_l1", masked_l1},   {"masked_ssim", masked_ssim}, {"normalised_depth", normalised_depth},
    {"smoothness", smoothness}, {"render", render},
};

static Operation *operation_named(const char *name)
{
    for (size_t k = 0; k < sizeof OPERATIONS / sizeof *OPERATIONS; k++)
        if (strcmp(OPERATIONS[k].name, name) == 0)
            return OPERATIONS[k].run;
    return NULL;
}

/* Every folder on the way to `path`. */
static void make_folders(char *path)
{
    for (char *at = path + 1;; at++) {
        if (*at && *at != '/')
            continue;
        char kept = *at;
        *at = 0;
        if (mkdir(path, 0777) != 0 && errno != EEXIST)
            fail("%s: cannot be made", path);
        *at = kept;
        if (!kept)
            return;
    }
}

/* One operation a line, each once. */
static void note_missing(char *missing, size_t size, const char *operation)
{
    char line[LONGEST_NAME + 2];
    snprintf(line, sizeof line, "%s\n", operation);
    if (!strstr(missing, line) && strlen(missing) + strlen(line) < size)
        strcat(missing, line);
}

int main(int count, char **words)
{
    char path[LONGEST_PATH], name[LONGEST_NAME * 2], operation[LONGEST_NAME], precision[16], missing[4096] = "\n";
    if (count != 3)
        fail("usage: port REQUESTS OUTPUTS");
    snprintf(path, sizeof path, "%s/requests.json", words[1]);
    char *head = read_text(path);
    json_text(json_find(head, "precision"), precision, sizeof precision);
    if (strcmp(precision, sizeof(real) == 8 ? "float64" : "float32") != 0)
        fail("asked for %s: compile with the other -DREAL", precision);
    const char *cases = json_find(head, "cases"), *entry;
    for (int k = 0; cases && (entry = json_item(cases, k)) != NULL; k++) {
        Request request;
        json_text(entry, name, sizeof name);
        request_open(&request, words[1], words[2], name);
        json_text(json_find(request.text, "operation"), operation, sizeof operation);
        Operation *run = operation_named(operation);
        if (run) {
            make_folders(request.target);
            run(&request);
        } else {
            note_missing(missing, sizeof missing, operation);
        }
        request_close(&request);
    }
    free(head);
    snprintf(path, sizeof path, "%s/not_ported.txt", words[2]);
    FILE *file = fopen(path, "wb");
    if (!file || fputs(missing + 1, file) == EOF || fclose(file) != 0)
        fail("%s: cannot be written", path);
    return 0;
}

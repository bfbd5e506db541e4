/* A request: its inputs and settings by name, and its outputs, whose shapes request.json states. */
#include "port.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static void join(char *out, const char *folder, const char *name)
{
    if (snprintf(out, LONGEST_PATH, "%s/%s", folder, name) >= LONGEST_PATH)
        fail("%s: path too long", name);
}

void request_open(Request *request, const char *requests, const char *outputs, const char *name)
{
    char path[LONGEST_PATH];
    memset(request, 0, sizeof *request);
    join(request->folder, requests, name);
    join(request->target, outputs, name);
    join(path, request->folder, "request.json");
    request->text = read_text(path);
}

/* Writes the outputs that the case asks for and frees everything. */
void request_close(Request *request)
{
    char path[LONGEST_PATH], file[LONGEST_NAME + 8];
    for (int k = 0; k < request->output_count; k++) {
        Array *array = &request->outputs[k];
        sprintf(file, "%s.npy", array->name);
        join(path, request->target, file);
        if (array->rank >= 0)
            npy_write(path, array);
        free(array->data);
    }
    for (int k = 0; k < request->input_count; k++)
        free(request->inputs[k].data);
    for (int k = 0; k < request->scratch_count; k++)
        free(request->scratch[k]);
    free(request->text);
}

static const char *lookup(const Request *request, const char *room, const char *name)
{
    char path[2 * LONGEST_NAME];
    snprintf(path, sizeof path, "%s.%s", room, name);
    return json_find(request->text, path);
}

static const Array *input(Request *request, const char *name, char kind)
{
    for (int k = 0; k < request->input_count; k++)
        if (strcmp(request->inputs[k].name, name) == 0 && (!kind || kind == request->inputs[k].kind))
            return &request->inputs[k];
    char file[LONGEST_PATH], path[LONGEST_PATH];
    json_text(lookup(request, "inputs", name), file, sizeof file);
    if (!*file || request->input_count == MOST_ARRAYS)
        fail("%s: no input %s", request->folder, name);
    join(path, request->folder, file);
    Array *array = &request->inputs[request->input_count++];
    snprintf(array->name, sizeof array->name, "%s", name);
    npy_read(path, array);
    if (kind && array->kind != kind)
        fail("%s: input %s has another type", request->folder, name);
    return array;
}

const real *in_real(Request *request, const char *name) { return input(request, name, 'f')->data; }
const int64_t *in_integer(Request *request, const char *name) { return input(request, name, 'i')->data; }
const uint8_t *in_boolean(Request *request, const char *name) { return input(request, name, 'b')->data; }

long in_size(Request *request, const char *name, int axis)
{
    const Array *array = input(request, name, 0);
    axis += axis < 0 ? array->rank : 0;
    if (axis < 0 || axis >= array->rank)
        fail("%s: input %s has %d axes", request->folder, name, array->rank);
    return array->shape[axis];
}

static const char *known_setting(const Request *request, const char *path)
{
    const char *value = lookup(request, "settings", path);
    if (!value)
        fail("%s: no setting %s", request->folder, path);
    return value;
}

double setting(const Request *request, const char *path) { return strtod(known_setting(request, path), NULL); }

bool setting_is(const Request *request, const char *path, const char *word)
{
    const char *value = known_setting(request, path);
    value += *value == '"';
    size_t length = strlen(word);
    return strncmp(value, word, length) == 0 && strchr("\",}\r\n ", value[length]) != NULL;
}

void setting_text(const Request *request, const char *path, char *out, size_t size)
{
    json_text(known_setting(request, path), out, size);
}

/* The shape comes from the request; an output that is not asked for gets rank -1 and is not written. */
static void *output(Request *request, const char *name, long count, char kind, size_t size)
{
    if (request->output_count == MOST_ARRAYS)
        fail("%s: too many outputs", request->folder);
    Array *array = &request->outputs[request->output_count++];
    snprintf(array->name, sizeof array->name, "%s", name);
    array->kind = kind;
    array->count = count;
    array->data = zeros(count, size);
    char path[2 * LONGEST_NAME];
    snprintf(path, sizeof path, "outputs.%s.shape", name);
    const char *shape = json_find(request->text, path), *entry;
    array->rank = shape ? 0 : -1;
    if (!shape)
        return array->data;
    long asked = 1;
    while (array->rank < MOST_AXES && (entry = json_item(shape, array->rank)) != NULL)
        asked *= array->shape[array->rank++] = strtol(entry, NULL, 10);
    if (asked != count)
        fail("%s: %s has %ld entries, asked for %ld", request->folder, name, count, asked);
    return array->data;
}

real *out_real(Request *request, const char *name, long count)
{
    return output(request, name, count, 'f', sizeof(real));
}

int64_t *out_integer(Request *request, const char *name, long count) { return output(request, name, count, 'i', 8); }
uint64_t *out_unsigned(Request *request, const char *name, long count) { return output(request, name, count, 'u', 8); }
uint8_t *out_boolean(Request *request, const char *name, long count) { return output(request, name, count, 'b', 1); }

real *scratch(Request *request, long count)
{
    if (request->scratch_count == MOST_ARRAYS)
        fail("%s: too much scratch", request->folder);
    return request->scratch[request->scratch_count++] = zeros(count, sizeof(real));
}

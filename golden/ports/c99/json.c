/* Just enough JSON to look values up: no tree is built, a value is a pointer to its first character. */
#include "port.h"

#include <ctype.h>
#include <string.h>

static const char *blank(const char *at)
{
    while (isspace((unsigned char)*at))
        at++;
    return at;
}

static const char *after_text(const char *at) /* at: the opening quote */
{
    for (at++; *at && *at != '"'; at++)
        if (*at == '\\' && at[1])
            at++;
    return *at ? at + 1 : at;
}

static const char *after_value(const char *at)
{
    int depth = 0;
    at = blank(at);
    do {
        if (*at == '"') {
            at = after_text(at);
            continue;
        }
        if (!*at)
            return at;
        depth += (*at == '{' || *at == '[') - (*at == '}' || *at == ']');
        at++;
    } while (depth > 0 || (*at && !strchr(",]}", *at)));
    return at;
}

static const char *member(const char *at, const char *key, size_t length)
{
    at = blank(at);
    if (*at != '{')
        return NULL;
    for (at = blank(at + 1); *at == '"'; at = blank(at + 1)) {
        const char *name = at + 1, *end = after_text(at);
        const char *value = blank(blank(end) + 1);
        if ((size_t)(end - name) == length + 1 && strncmp(name, key, length) == 0)
            return value;
        at = blank(after_value(value));
        if (*at != ',')
            return NULL;
    }
    return NULL;
}

/* The value at a path of keys such as "settings.raster.near", or NULL. */
const char *json_find(const char *value, const char *path)
{
    while (value && *path) {
        size_t length = strcspn(path, ".");
        value = member(value, path, length);
        path += length + (path[length] == '.');
    }
    return value;
}

/* Entry of a list, or NULL behind its end. */
const char *json_item(const char *value, int index)
{
    const char *at = blank(value);
    if (*at != '[')
        return NULL;
    for (at = blank(at + 1); *at && *at != ']'; at = blank(at + 1)) {
        if (index-- == 0)
            return at;
        at = blank(after_value(at));
        if (*at != ',')
            return NULL;
    }
    return NULL;
}

/* A text without escapes, cut to the size of `out`. */
void json_text(const char *value, char *out, size_t size)
{
    size_t length = 0;
    if (value && *value == '"')
        for (value++; value[length] && value[length] != '"' && length + 1 < size; length++)
            out[length] = value[length];
    out[length] = 0;
}

/* Drives one instance of a unit by a script and prints what it gives, bit for bit, on any platform that zig compiles
 * for.
 *
 *   drive LIBRARY SCRIPT RESULT [LIBRARY SCRIPT RESULT]..     paths in UTF-8; SCRIPT and RESULT are plain ASCII files
 *
 * Compiled with -DSTATIC_UNITS, units are linked into it (static_units.h, generated, has their functions), and LIBRARY
 * is a unit's name.
 *
 * Script, words separated by white space; numbers of type double are the 16 hexadecimal digits of their bits:
 *
 *   name guid resources                resources: a URI, or - for none
 *   h steps
 *   count_of_parameters                then: reference value, each
 *   count_of_inputs                    then: references
 *   count_of_outputs                   then: references
 *   (steps + 1) rows of values of the inputs; they run linearly from row to row
 *
 * Result: a row per communication point, the outputs' bits. What the unit logs goes to the standard error stream. */
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "fmi2FunctionTypes.h"

#ifdef STATIC_UNITS
#include "static_units.h" /* struct { const char *unit, *name; void (*address)(void); } static_units[], ended by NULL */
static void *load(const char *path) {
    static char unit[64];
    return strlen(path) < sizeof unit ? strcpy(unit, path) : NULL;
}
static void *symbol(void *library, const char *name) {
    for (size_t i = 0; static_units[i].unit != NULL; i++) {
        if (strcmp(static_units[i].unit, library) == 0 && strcmp(static_units[i].name, name) == 0) {
            void *found;
            memcpy(&found, &static_units[i].address, sizeof found);
            return found;
        }
    }
    return NULL;
}
static FILE *open_file(const char *path, const char *mode) {
    return fopen(path, mode);
}
#elif defined _WIN32
#define WIN32_LEAN_AND_MEAN
#include <windows.h>
static wchar_t *wide(const char *text) {
    const int length = MultiByteToWideChar(CP_UTF8, MB_ERR_INVALID_CHARS, text, -1, NULL, 0);
    wchar_t *path = calloc((size_t)length + 1, sizeof *path);
    if (path != NULL) {
        MultiByteToWideChar(CP_UTF8, MB_ERR_INVALID_CHARS, text, -1, path, length);
    }
    return path;
}
static void *load(const char *path) {
    return (void *)LoadLibraryW(wide(path));
}
static void *symbol(void *library, const char *name) {
    void *found;
    const FARPROC address = GetProcAddress((HMODULE)library, name);
    memcpy(&found, &address, sizeof found);
    return found;
}
static FILE *open_file(const char *path, const char *mode) {
    return _wfopen(wide(path), wide(mode));
}
#else
#include <dlfcn.h>
static void *load(const char *path) {
    void *library = dlopen(path, RTLD_NOW | RTLD_LOCAL);
    if (library == NULL) {
        fprintf(stderr, "drive: %s\n", dlerror());
    }
    return library;
}
static void *symbol(void *library, const char *name) {
    return dlsym(library, name);
}
static FILE *open_file(const char *path, const char *mode) {
    return fopen(path, mode);
}
#endif

enum { MOST = 256, LENGTH = 4096 };

static FILE *script;

static const char *word(void) {
    static char text[LENGTH];
    if (fscanf(script, "%4095s", text) != 1) {
        fprintf(stderr, "drive: the script ends early\n");
        exit(2);
    }
    return text;
}

static size_t whole(void) {
    return (size_t)strtoul(word(), NULL, 10);
}

static double number(void) {
    const uint64_t bits = strtoull(word(), NULL, 16);
    double value;
    memcpy(&value, &bits, sizeof value);
    return value;
}

static void print(FILE *result, const double values[], size_t count) {
    for (size_t i = 0; i < count; i++) {
        uint64_t bits;
        memcpy(&bits, &values[i], sizeof bits);
        fprintf(result, "%08lx%08lx%c", (unsigned long)(bits >> 32), (unsigned long)(bits & 0xffffffffu),
                i + 1 < count ? ' ' : '\n');
    }
    if (count == 0) {
        fprintf(result, "\n");
    }
}

static void tell(fmi2ComponentEnvironment environment, fmi2String instance, fmi2Status status, fmi2String category,
                 fmi2String message, ...) {
    (void)environment;
    fprintf(stderr, "%s [%s, %d] %s\n", instance, category, (int)status, message);
}

static void must(int good, const char *what) {
    if (!good) {
        fprintf(stderr, "drive: %s failed\n", what);
        exit(1);
    }
}

#define FUNCTION(type) fmi2##type##TYPE *type = NULL
#define FIND(type)                                                                                                     \
    do {                                                                                                               \
        void *found = symbol(library, "fmi2" #type);                                                                   \
        must(found != NULL, "fmi2" #type);                                                                             \
        memcpy(&type, &found, sizeof found);                                                                           \
    } while (0)
#define MUST(call) must((call) == fmi2OK, #call)

static int drive(const char *path, FILE *result) {
    void *library = load(path);
    must(library != NULL, "loading the library");
    FUNCTION(Instantiate);
    FUNCTION(SetupExperiment);
    FUNCTION(EnterInitializationMode);
    FUNCTION(ExitInitializationMode);
    FUNCTION(SetReal);
    FUNCTION(GetReal);
    FUNCTION(SetRealInputDerivatives);
    FUNCTION(DoStep);
    FUNCTION(Terminate);
    FUNCTION(FreeInstance);
    FIND(Instantiate);
    FIND(SetupExperiment);
    FIND(EnterInitializationMode);
    FIND(ExitInitializationMode);
    FIND(SetReal);
    FIND(GetReal);
    FIND(SetRealInputDerivatives);
    FIND(DoStep);
    FIND(Terminate);
    FIND(FreeInstance);

    static char name[LENGTH], guid[LENGTH], resources[LENGTH];
    static fmi2ValueReference inputs[MOST], outputs[MOST];
    static fmi2Integer first[MOST];
    static double now[MOST], next[MOST], slope[MOST], values[MOST];
    strcpy(name, word());
    strcpy(guid, word());
    strcpy(resources, word());
    const double h = number();
    const size_t steps = whole();
    const fmi2CallbackFunctions callbacks = {tell, calloc, free, NULL, NULL};
    fmi2Component c = Instantiate(name, fmi2CoSimulation, guid, strcmp(resources, "-") ? resources : NULL, &callbacks,
                                  fmi2False, fmi2False);
    must(c != NULL, "fmi2Instantiate");
    for (size_t i = whole(); i > 0; i--) {
        const fmi2ValueReference reference = (fmi2ValueReference)whole();
        const double value = number();
        MUST(SetReal(c, &reference, 1, &value));
    }
    const size_t driven = whole();
    must(driven <= MOST, "as many inputs");
    for (size_t i = 0; i < driven; i++) {
        inputs[i] = (fmi2ValueReference)whole();
        first[i] = 1;
    }
    const size_t read = whole();
    must(read <= MOST, "as many outputs");
    for (size_t i = 0; i < read; i++) {
        outputs[i] = (fmi2ValueReference)whole();
    }
    for (size_t i = 0; i < driven; i++) {
        now[i] = number();
    }
    MUST(SetupExperiment(c, fmi2False, 0, 0, fmi2False, 0));
    MUST(EnterInitializationMode(c));
    if (driven > 0) {
        MUST(SetReal(c, inputs, driven, now));
    }
    MUST(ExitInitializationMode(c));
    MUST(GetReal(c, outputs, read, values));
    print(result, values, read);
    for (size_t k = 0; k < steps; k++) {
        for (size_t i = 0; i < driven; i++) {
            next[i] = number();
            slope[i] = (next[i] - now[i]) / h;
        }
        if (driven > 0) {
            MUST(SetReal(c, inputs, driven, now));
            MUST(SetRealInputDerivatives(c, inputs, driven, first, slope));
        }
        MUST(DoStep(c, (double)k * h, h, fmi2True));
        MUST(GetReal(c, outputs, read, values));
        print(result, values, read);
        memcpy(now, next, sizeof now);
    }
    MUST(Terminate(c));
    FreeInstance(c);
    return 0;
}

static int run(const char *library, const char *script_path, const char *result_path) {
    script = open_file(script_path, "rb");
    must(script != NULL, "opening the script");
    FILE *result = open_file(result_path, "wb");
    must(result != NULL, "opening the result");
    const int status = drive(library, result);
    must(fclose(result) == 0, "writing the result");
    fclose(script);
    return status;
}

#ifdef _WIN32
/* main() would get the arguments in the code page of the process. */
int wmain(int count, wchar_t *words[]) {
    static char text[4][LENGTH];
    if (count != 4) {
        return 2;
    }
    for (int i = 1; i < 4; i++) {
        WideCharToMultiByte(CP_UTF8, 0, words[i], -1, text[i], LENGTH, NULL, NULL);
    }
    return run(text[1], text[2], text[3]);
}
#else
int main(int count, char *words[]) {
    int status = count < 4 || count % 3 != 1 ? 2 : 0;
    for (int i = 1; status == 0 && i < count; i += 3) {
        status = run(words[i], words[i + 1], words[i + 2]);
    }
    return status;
}
#endif

/* Bytes as calls: whatever an importer may do to a unit, legal or not, from what a fuzzer makes up.
 *
 *   LLVMFuzzerTestOneInput(data, size)   for libFuzzer, or for driver.c where the compiler has none
 *
 * Compiled together with the sources of one unit; RESOURCES is the folder of its files.
 * Every instance has a twin. Both get the same calls, but the twin none of the detours: what was refused, what an
 * allocation failed in, and everything between saving a state and restoring it. Whatever can be read of the two must
 * remain the same to the last bit. Every status is held against what the table of variables and the state of the
 * instance say of the call. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "fmi2Functions.h"
#include "shell.h"
#include "state.h"
#include "values.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);
int LLVMFuzzerInitialize(int *count, char ***words);

enum { MOST = 40, FILES = 4, FILE_ROOM = 8192, PATH_ROOM = 512, PAIRS = 2, DEEPEST = 2, MOST_CYCLES = 2000 };

/* --- faults */

static const char *doing = "nothing";

static void fault(const char *what) {
    fprintf(stderr, "FAULT in %s: %s\n", doing, what);
    abort();
}

static void must(bool good, const char *what) {
    if (!good)
        fault(what);
}

/* --- bytes */

static const uint8_t *at, *end;

static unsigned byte(void) {
    return at < end ? *at++ : 0;
}

static uint64_t bytes(unsigned count) {
    uint64_t value = 0;
    while (count-- > 0)
        value = value << 8 | byte();
    return value;
}

static double number(void) {
    static const double special[] = {0,       -0.0,  NAN,   -NAN,   INFINITY, -INFINITY, 1e308, -1.7e308,
                                     5e-324,  1e-9,  -1e-9, 1e150,  -1e151,   1e-308,    1,     -1,
                                     1.25e-4, 1e-30, 1e9,   2.5e-4, 1e-3,     1e16,      0.5,   1e-6};
    static const double scale[] = {1e-9, 1e-6, 1e-4, 1e-3, 1e-2, 1, 100, 1e6};
    const unsigned kind = byte();
    if (kind < sizeof special / sizeof *special)
        return special[kind];
    if (kind < 32) {
        const uint64_t bits = bytes(8);
        double value;
        memcpy(&value, &bits, sizeof value);
        return value;
    }
    return scale[kind % 8] * (double)((int)byte() - 128) / 100;
}

/* --- the importer's side: memory, messages */

static long held, fail_in; /* allocations that live; the how-manieth next one fails, 0: none */
static bool short_of_memory;
static uint8_t junk;
static int errors_told;
static uint64_t calls_made, instances_made;

static void *allocate(size_t count, size_t size) {
    if (fail_in > 0 && --fail_in == 0) {
        short_of_memory = true;
        return NULL;
    }
    if (count > SIZE_MAX / (size + 1) || count * size > (size_t)1 << 28)
        return NULL;
    void *memory = malloc(count * size);
    if (memory != NULL) {
        memset(memory, junk, count * size); /* the standard wants zeroes; not every importer gives them */
        held++;
    }
    return memory;
}

static void give_back(void *memory) {
    must(memory != NULL, "freeMemory got NULL");
    held--;
    free(memory);
}

static void tell(fmi2ComponentEnvironment environment, fmi2String instance, fmi2Status status, fmi2String category,
                 fmi2String message, ...) {
    must(environment == &held, "the logger got another environment");
    must(strcmp(instance, "tried%s#1#") == 0 || short_of_memory, "the logger got another name");
    must(category != NULL && message != NULL && strlen(message) < 5000, "a message is no text");
    for (const char *c = message; *c != '\0'; c++) {
        must((unsigned char)*c >= 0x20 && *c != 0x7f, "a message holds a control character");
        if (*c == '%' || *c == '#') {
            must(c[1] == *c, "a message holds a single % or #");
            c++;
        }
    }
    if (status == fmi2Error)
        errors_told++;
}

static const fmi2CallbackFunctions callbacks = {tell, allocate, give_back, NULL, &held};

static void *volatile written;

static void keep_written(void *memory) {
    written = memory;
}

/* What a function left unset on the stack is another number for the twin. */
static void dirty_stack(void) {
    uint8_t waste[2048];
    memset(waste, junk, sizeof waste);
    keep_written(waste);
}

static void begin(bool twin) {
    junk = twin ? 0x41 : 0xbf; /* doubles of 2.2e6 and -0.12 */
    dirty_stack();
    errors_told = 0;
    calls_made++;
}

/* --- resource files, as they are or mutated, and the GUID that fits them */

typedef struct File {
    const char *name;
    uint8_t content[FILE_ROOM];
    size_t size;
} File;

static File files[FILES];
static size_t file_count;
static char other_modes[PATH_ROOM], scratch[PATH_ROOM], folder[PATH_ROOM], guid[GUID_SIZE];

static void read_base(const char *name) {
    File *file = &files[file_count];
    char path[PATH_ROOM];
    snprintf(path, sizeof path, "%s/%s", RESOURCES, name);
    FILE *stream = fopen(path, "rb");
    if (stream == NULL)
        return;
    file->name = name;
    file->size = fread(file->content, 1, sizeof file->content, stream);
    fclose(stream);
    file_count++;
}

static void write_file(const File *file) {
    char path[PATH_ROOM + 32];
    snprintf(path, sizeof path, "%s/%s", scratch, file->name);
    FILE *stream = fopen(path, "wb");
    must(stream != NULL && fwrite(file->content, 1, file->size, stream) == file->size && fclose(stream) == 0,
         "a file of the fuzzer's own cannot be written");
}

static void mutate_text(File *file, size_t place) {
    static const char *const pieces[] = {",",    "\n",   "1e308",  "-1", "nan", "\"",  "0",
                                         "\xff", "\r\n", "1e-320", ";",  "",    "2.5", "X"};
    const char *piece = pieces[byte() % (sizeof pieces / sizeof *pieces)];
    const size_t length = strlen(piece), gone = byte() % 8;
    const size_t behind = place + gone < file->size ? place + gone : file->size;
    if (file->size - (behind - place) + length > sizeof file->content)
        return;
    memmove(file->content + place + length, file->content + behind, file->size - behind);
    memcpy(file->content + place, piece, length);
    file->size = file->size - (behind - place) + length;
}

static void mutate_numbers(File *file, size_t place) {
    const double value = number();
    uint8_t image[8];
    memcpy(image, &value, sizeof image);
    place -= place % 8;
    memcpy(file->content + place, image, place + 8 <= file->size ? 8 : file->size - place);
    if (byte() % 16 == 0)
        file->size = place;
}

static void mutate(File *file) {
    for (unsigned count = 1 + byte() % 4; count > 0 && file->size > 0; count--) {
        const size_t place = (size_t)bytes(2) % (byte() < 128 || file->size < 256 ? file->size : 256);
        if (strstr(file->name, ".bin") != NULL)
            mutate_numbers(file, place);
        else
            mutate_text(file, place);
    }
}

/* Chooses the files of this input: those of the folder, without the last one, or some of them changed. */
static void choose_resources(void) {
    static File changed[FILES];
    const unsigned variant = byte() % 8;
    size_t count = file_count;
    uint64_t hash = HASH_OF_NOTHING;
    char own[HASH_TEXT_SIZE], theirs[HASH_TEXT_SIZE];
    if (variant == 1 && count > 1)
        count--;
    snprintf(folder, sizeof folder, "%s", variant < 1 || count == 0 ? RESOURCES : scratch);
    memcpy(changed, files, sizeof files);
    if (variant > 3 && count > 0)
        for (unsigned k = 1 + byte() % 2; k > 0; k--)
            mutate(&changed[byte() % count]);
    for (size_t i = 0; i < count; i++)
        hash = hash_bytes(hash, changed[i].content, changed[i].size);
    for (size_t i = 0; i < file_count && variant >= 1; i++) {
        char path[PATH_ROOM + 32];
        snprintf(path, sizeof path, "%s/%s", scratch, files[i].name);
        if (i < count)
            write_file(&changed[i]);
        else
            remove(path);
    }
    snprintf(guid, sizeof guid, "%s-%s", table_hash(own), hash_text(theirs, hash));
}

static void clear_scratch(void) {
    for (size_t i = 0; i < file_count; i++) {
        char path[PATH_ROOM + 32];
        snprintf(path, sizeof path, "%s/%s", scratch, files[i].name);
        remove(path);
    }
    rmdir(scratch);
    printf("calls %llu instances %llu\n", (unsigned long long)calls_made, (unsigned long long)instances_made);
}

int LLVMFuzzerInitialize(int *count, char ***words) {
    (void)count, (void)words;
    static const char *const names[] = {"axes.csv", "modes.csv", "setpoints.csv", "poses.bin"};
    for (size_t i = 0; i < FILES; i++)
        read_base(names[i]);
    snprintf(other_modes, sizeof other_modes, "%s/other_modes.csv", RESOURCES);
    const char *place = getenv("TMPDIR");
    snprintf(scratch, sizeof scratch, "%s/feedsim-fuzz-XXXXXX", place != NULL ? place : "/tmp");
    must(mkdtemp(scratch) != NULL, "no folder for files of the fuzzer's own");
    atexit(clear_scratch);
    return 0;
}

/* --- an instance and its twin */

typedef struct Pair {
    Unit *unit, *twin;
    Phase phase;       /* that the calls have led to */
    double time, stop; /* likewise */
} Pair;

static Pair pairs[PAIRS];
static unsigned depth; /* of detours */

static const Header *header_of(const Pair *pair) {
    return unit_header(pair->unit);
}

static Unit *instantiate(bool twin) {
    doing = "fmi2Instantiate";
    begin(twin);
    short_of_memory = false;
    instances_made++;
    return fmi2Instantiate("tried%s#1#", fmi2CoSimulation, guid, folder, &callbacks, fmi2False, fmi2False);
}

static void free_pair(Pair *pair) {
    doing = "fmi2FreeInstance";
    fmi2FreeInstance(pair->unit);
    fmi2FreeInstance(pair->twin);
    *pair = (Pair){.unit = NULL};
}

static void at_its_start(Pair *pair) {
    pair->phase = PHASE_INSTANTIATED;
    pair->time = 0;
    pair->stop = INFINITY;
}

/* Whether there are such instances, with those resources. */
static bool make_pair(Pair *pair) {
    pair->unit = instantiate(false);
    must((pair->unit == NULL) == (errors_told > 0), "refused without an error, or made with one");
    pair->twin = instantiate(true);
    must((pair->unit == NULL) == (pair->twin == NULL), "the same twice, and only one is made");
    at_its_start(pair);
    return pair->unit != NULL;
}

/* --- calls: their arguments, what is to be expected of them, their answers */

typedef struct Asked {
    Call call;
    Kind kind;   /* of the values */
    bool nobody; /* NULL for the component */
    size_t count, known_count;
    const fmi2ValueReference *references, *knowns;
    double *reals;
    int *wholes, *orders;
    fmi2String *texts;
    double t, h;
    bool flag;
    int status_kind;
} Asked;

typedef struct Answer {
    fmi2Status status;
    double reals[MOST];
    int wholes[MOST];
    uint64_t texts;
} Answer;

/* Arrays end where their memory does, so that one element too many is seen. */
static fmi2ValueReference reference_room[2][MOST];
static double real_room[MOST];
static int whole_room[MOST], order_room[MOST];
static fmi2String text_room[MOST];
#define LAST(room, count) ((count) <= MOST ? (room) + MOST - (count) : (room))

static size_t some_count(void) {
    const unsigned kind = byte();
    return kind < 160 ? 1 : kind < 240 ? kind % MOST : kind < 252 ? 0 : kind < 254 ? SIZE_MAX : MOST_ELEMENTS + 1;
}

static fmi2ValueReference some_reference(const Unit *unit, Kind kind) {
    const unsigned choice = byte();
    if (choice > 250)
        return (fmi2ValueReference)bytes(4);
    const fmi2ValueReference first = choice % (fmi2ValueReference)(unit->variable_count + 1);
    fmi2ValueReference found = first;
    while (choice < 200 && found < unit->variable_count && unit->variables[found].info->kind != kind)
        found++;
    return found;
}

static bool absent(void) {
    return byte() > 250;
}

static const fmi2ValueReference *some_references(const Unit *unit, Kind kind, size_t count, size_t room) {
    for (size_t i = 0; i < count && i < MOST; i++)
        LAST(reference_room[room], count)[i] = some_reference(unit, kind);
    return absent() ? NULL : LAST(reference_room[room], count);
}

/* Half of them within a factor of the start value: those are mostly allowed. */
static double some_real(const Unit *unit, fmi2ValueReference reference) {
    const unsigned kind = byte();
    if (kind < 128 || reference >= unit->variable_count)
        return number();
    const VariableInfo *info = unit->variables[reference].info;
    return kind < 132   ? info->min
           : kind < 136 ? info->max
                        : info->start * (1 + 0.01 * ((int)kind - 192)) + (info->start != 0 ? 0 : 1e-3 * (kind - 192));
}

static fmi2String some_text(void) {
    static char endless[STRING_SIZE + 2];
    memset(endless, 'x', STRING_SIZE);
    const fmi2String known[] = {"", other_modes, "no such file", NULL, endless, endless + 1, "\xff%n\n", "?"};
    return known[byte() % (sizeof known / sizeof *known)];
}

static double some_step(const Pair *pair) {
    const unsigned kind = byte();
    return kind < 128   ? 1e-4 * (1 + kind % 16)
           : kind < 160 ? 1e-6 * kind
           : kind < 176 ? pair->stop - pair->time
                        : number();
}

static double some_time(const Pair *pair) {
    const unsigned kind = byte();
    return kind < 200   ? pair->time
           : kind < 216 ? nextafter(pair->time, kind % 2 ? INFINITY : -INFINITY)
           : kind < 224 ? pair->time + 1e-6
                        : number();
}

static Asked some_call(const Pair *pair, Call call) {
    static const fmi2String categories[] = {
        "logAll", "logStatusError", "logStatusWarning", "logEvents", "logFmi2Call", "%s", NULL, ""};
    const Unit *unit = pair->unit;
    Asked asked = {.call = call, .nobody = byte() > 253};
    asked.kind = call == CALL_GetInteger || call == CALL_SetInteger   ? KIND_INTEGER
                 : call == CALL_GetBoolean || call == CALL_SetBoolean ? KIND_BOOLEAN
                 : call == CALL_GetString || call == CALL_SetString   ? KIND_STRING
                                                                      : KIND_REAL;
    switch (call) {
    case CALL_SetDebugLogging:
    case CALL_GetReal:
    case CALL_GetInteger:
    case CALL_GetBoolean:
    case CALL_GetString:
    case CALL_SetReal:
    case CALL_SetInteger:
    case CALL_SetBoolean:
    case CALL_SetString:
    case CALL_GetDirectionalDerivative:
    case CALL_SetRealInputDerivatives:
    case CALL_GetRealOutputDerivatives:
        asked.flag = byte() < 200;
        asked.count = some_count();
        asked.references = some_references(unit, asked.kind, asked.count, 0);
        asked.reals = absent() ? NULL : LAST(real_room, asked.count);
        asked.wholes = asked.reals == NULL ? NULL : LAST(whole_room, asked.count);
        asked.orders = absent() ? NULL : LAST(order_room, asked.count);
        asked.texts = asked.reals == NULL ? NULL : LAST(text_room, asked.count);
        if (call == CALL_GetDirectionalDerivative) {
            asked.known_count = some_count();
            asked.knowns = some_references(unit, KIND_REAL, asked.known_count, 1);
        }
        for (size_t i = 0; i < asked.count && i < MOST; i++) {
            LAST(order_room, asked.count)[i] = byte() > 250 ? (int)bytes(4) : 1;
            if (call == CALL_SetReal || call == CALL_SetRealInputDerivatives)
                LAST(real_room, asked.count)[i] = some_real(unit, LAST(reference_room[0], asked.count)[i]);
            if (call == CALL_SetInteger || call == CALL_SetBoolean)
                LAST(whole_room, asked.count)[i] = byte() < 200 ? (int)byte() % 8 - 1 : (int)bytes(4);
            if (call == CALL_SetString)
                LAST(text_room, asked.count)[i] = some_text();
            if (call == CALL_SetDebugLogging)
                LAST(text_room, asked.count)[i] = categories[byte() % (sizeof categories / sizeof *categories)];
        }
        break;
    case CALL_SetupExperiment:
        asked.flag = byte() < 64;
        asked.t = byte() < 128 ? 0 : number();
        asked.h = byte() < 128 ? asked.t + 1 : number();
        break;
    case CALL_DoStep:
        asked.t = some_time(pair);
        asked.h = some_step(pair);
        break;
    default:
        asked.flag = absent();
        asked.status_kind = (int)(byte() % 6) - 1;
        break;
    }
    return asked;
}

/* --- what is to be expected: BAD leaves everything as it was */

typedef enum Expected { GOOD, BAD, EITHER } Expected;

static bool in_range_of(const VariableInfo *info, double value) {
    return isfinite(value) && value >= info->min && value <= info->max;
}

static bool settable_in(Phase phase, const VariableInfo *info) {
    return info->causality == CAUSALITY_input ||
           (info->causality == CAUSALITY_parameter &&
            (phase != PHASE_STEPPING || info->variability == VARIABILITY_tunable));
}

/* Whether element i is one that the function takes. */
static bool fits(const Pair *pair, const Asked *asked, size_t i) {
    const fmi2ValueReference reference = asked->references[i];
    if (reference >= pair->unit->variable_count)
        return false;
    const VariableInfo *info = pair->unit->variables[reference].info;
    if (info->kind != asked->kind)
        return false;
    switch (asked->call) {
    case CALL_SetReal:
        return settable_in(pair->phase, info) && in_range_of(info, asked->reals[i]);
    case CALL_SetInteger:
    case CALL_SetBoolean:
        return settable_in(pair->phase, info) && in_range_of(info, asked->wholes[i]);
    case CALL_SetString:
        return settable_in(pair->phase, info) && asked->texts[i] != NULL && strlen(asked->texts[i]) < STRING_SIZE;
    case CALL_SetRealInputDerivatives:
        return info->causality == CAUSALITY_input && asked->orders[i] == 1 && isfinite(asked->reals[i]);
    case CALL_GetRealOutputDerivatives:
        return info->causality == CAUSALITY_output && asked->orders[i] == 1;
    case CALL_GetDirectionalDerivative:
        return info->causality == CAUSALITY_output;
    default:
        return true;
    }
}

static Expected expected_of_arrays(const Pair *pair, const Asked *asked) {
    const bool ordered = asked->call == CALL_SetRealInputDerivatives || asked->call == CALL_GetRealOutputDerivatives;
    if (asked->count > MOST || asked->known_count > MOST ||
        (asked->count > 0 &&
         (asked->references == NULL || asked->reals == NULL || (ordered && asked->orders == NULL))) ||
        (asked->known_count > 0 && asked->knowns == NULL))
        return BAD;
    for (size_t i = 0; i < asked->count; i++)
        if (!fits(pair, asked, i))
            return BAD;
    for (size_t i = 0; i < asked->known_count; i++)
        if (asked->knowns[i] >= pair->unit->variable_count ||
            pair->unit->variables[asked->knowns[i]].info->causality != CAUSALITY_input ||
            pair->unit->variables[asked->knowns[i]].info->kind != KIND_REAL)
            return BAD;
    if (asked->call >= CALL_SetReal && asked->call <= CALL_SetString)
        return GOOD;
    return asked->call == CALL_SetRealInputDerivatives ? GOOD : EITHER; /* parameters were refused, overflow */
}

static Expected expected(const Pair *pair, const Asked *asked) {
#define PHASES_OF(name, phases) PHASES_##name,
    static const unsigned phases[] = {CALLS(PHASES_OF)};
#undef PHASES_OF
    if (asked->nobody || !(phases[asked->call] & 1u << pair->phase))
        return BAD;
    switch (asked->call) {
    case CALL_SetDebugLogging:
        return asked->count > MOST || (asked->count > 0 && asked->reals == NULL) ? BAD : GOOD;
    case CALL_SetupExperiment:
        return isfinite(asked->t) && (!asked->flag || asked->h >= asked->t) ? GOOD : BAD;
    case CALL_DoStep:
        return isfinite(asked->h) && asked->h > 0 &&
                       fabs(asked->t - pair->time) <= 0.1 * asked->h + 1e-9 * fabs(asked->t)
                   ? EITHER
                   : BAD;
    case CALL_ExitInitializationMode:
        return EITHER; /* parameters that do not go together */
    case CALL_EnterInitializationMode:
    case CALL_Terminate:
    case CALL_Reset:
    case CALL_GetStatus:
    case CALL_GetRealStatus:
    case CALL_GetIntegerStatus:
    case CALL_GetBooleanStatus:
    case CALL_GetStringStatus:
        return GOOD;
    default:
        return expected_of_arrays(pair, asked);
    }
}

/* --- to one instance */

static void answer_texts(Answer *answer, const Asked *asked) {
    answer->texts = HASH_OF_NOTHING;
    for (size_t i = 0; i < asked->count && answer->status == fmi2OK; i++)
        answer->texts = hash_bytes(answer->texts, asked->texts[i], strlen(asked->texts[i]) + 1);
}

static Answer perform(Unit *unit, const Asked *asked) {
    Answer answer = {.status = fmi2Fatal};
    const Asked *a = asked;
    fmi2Component c = a->nobody ? NULL : unit;
    double *reals = a->reals != NULL ? LAST(answer.reals, a->count) : NULL;
    int *wholes = a->wholes != NULL ? LAST(answer.wholes, a->count) : NULL;
    fmi2Status told = fmi2OK;
    fmi2String text = NULL;
    doing = a->nobody ? "a function of nobody" : call_name(a->call);
    switch (a->call) {
    case CALL_SetDebugLogging:
        answer.status = fmi2SetDebugLogging(c, a->flag, a->count, a->texts);
        break;
    case CALL_SetupExperiment:
        answer.status = fmi2SetupExperiment(c, fmi2True, 1e-6, a->t, a->flag, a->h);
        break;
    case CALL_EnterInitializationMode:
        answer.status = fmi2EnterInitializationMode(c);
        break;
    case CALL_ExitInitializationMode:
        answer.status = fmi2ExitInitializationMode(c);
        break;
    case CALL_Terminate:
        answer.status = fmi2Terminate(c);
        break;
    case CALL_Reset:
        answer.status = fmi2Reset(c);
        break;
    case CALL_GetReal:
        answer.status = fmi2GetReal(c, a->references, a->count, reals);
        break;
    case CALL_GetInteger:
        answer.status = fmi2GetInteger(c, a->references, a->count, wholes);
        break;
    case CALL_GetBoolean:
        answer.status = fmi2GetBoolean(c, a->references, a->count, wholes);
        break;
    case CALL_GetString:
        answer.status = fmi2GetString(c, a->references, a->count, a->texts);
        answer_texts(&answer, a);
        break;
    case CALL_SetReal:
        answer.status = fmi2SetReal(c, a->references, a->count, a->reals);
        break;
    case CALL_SetInteger:
        answer.status = fmi2SetInteger(c, a->references, a->count, a->wholes);
        break;
    case CALL_SetBoolean:
        answer.status = fmi2SetBoolean(c, a->references, a->count, a->wholes);
        break;
    case CALL_SetString:
        answer.status = fmi2SetString(c, a->references, a->count, a->texts);
        break;
    case CALL_GetDirectionalDerivative: {
        double seed[MOST];
        for (size_t i = 0; i < MOST; i++)
            seed[i] = 1 - 0.25 * (double)i;
        answer.status =
            fmi2GetDirectionalDerivative(c, a->references, a->count, a->knowns, a->known_count, seed, reals);
        break;
    }
    case CALL_SetRealInputDerivatives:
        answer.status = fmi2SetRealInputDerivatives(c, a->references, a->count, a->orders, a->reals);
        break;
    case CALL_GetRealOutputDerivatives:
        answer.status = fmi2GetRealOutputDerivatives(c, a->references, a->count, a->orders, reals);
        break;
    case CALL_DoStep:
        answer.status = fmi2DoStep(c, a->t, a->h, a->flag);
        break;
    case CALL_GetStatus:
        answer.status = fmi2GetStatus(c, (fmi2StatusKind)a->status_kind, a->flag ? NULL : &told);
        answer.wholes[0] = (int)told;
        break;
    case CALL_GetRealStatus:
        answer.status = fmi2GetRealStatus(c, (fmi2StatusKind)a->status_kind, a->flag ? NULL : answer.reals);
        break;
    case CALL_GetIntegerStatus:
        answer.status = fmi2GetIntegerStatus(c, (fmi2StatusKind)a->status_kind, a->flag ? NULL : answer.wholes);
        break;
    case CALL_GetBooleanStatus:
        answer.status = fmi2GetBooleanStatus(c, (fmi2StatusKind)a->status_kind, a->flag ? NULL : answer.wholes);
        break;
    case CALL_GetStringStatus:
        answer.status = fmi2GetStringStatus(c, (fmi2StatusKind)a->status_kind, a->flag ? NULL : &text);
        break;
    default:
        answer.status = fmi2CancelStep(c);
        break;
    }
    return answer;
}

/* A controller works its cycles one by one: steps of millions of them, and states that lag far behind their time, are
 * slow, not wrong. */
static bool takes_long(const Pair *pair, const Asked *asked) {
    for (size_t i = 0; i < SCALAR_ROWS && asked->call == CALL_DoStep; i++) {
        if (strcmp(table_scalars[i].name, "T_c") == 0 && pair->phase == PHASE_STEPPING) {
            const double T_c = *unit_real(pair->unit, (unsigned)i), start = header_of(pair)->start_time;
            int64_t instant;
            memcpy(&instant, unit_state(pair->unit), sizeof instant);
            const double cycles = (asked->t + asked->h - start) / T_c - (double)instant;
            return cycles > MOST_CYCLES && cycles < 2e9;
        }
    }
    return false;
}

/* --- to both, and what must hold then */

static void results_are_finite(const Pair *pair, const Asked *asked, const Answer *answer) {
    if (asked->call != CALL_GetReal || answer->status != fmi2OK || pair->phase == PHASE_FAILED)
        return;
    for (size_t i = 0; i < MOST; i++)
        must(isfinite(answer->reals[i]), "what was read is not finite");
}

/* What the call has made of the instance. */
static void follow(Pair *pair, const Asked *asked, const Answer *answer) {
    if (answer->status == fmi2OK) {
        switch (asked->call) {
        case CALL_SetupExperiment:
            pair->time = asked->t;
            pair->stop = asked->flag ? asked->h : INFINITY;
            break;
        case CALL_EnterInitializationMode:
            pair->phase = PHASE_INITIALIZATION;
            break;
        case CALL_ExitInitializationMode:
            pair->phase = PHASE_STEPPING;
            break;
        case CALL_Terminate:
            pair->phase = PHASE_TERMINATED;
            break;
        case CALL_Reset:
            at_its_start(pair);
            break;
        case CALL_DoStep:
            pair->time = asked->t + asked->h;
            must(pair->time <= pair->stop + 0.1 * asked->h + 1e-9 * fabs(pair->stop), "past the stop time");
            break;
        default:
            break;
        }
    } else if (asked->call == CALL_DoStep && header_of(pair)->phase == PHASE_FAILED) {
        pair->phase = PHASE_FAILED;
    }
    must(header_of(pair)->phase == (uint32_t)pair->phase, "the instance is in another state");
    must(!(header_of(pair)->time < pair->time || header_of(pair)->time > pair->time), "it stands at another time");
}

static void ask(Pair *pair, const Asked *asked) {
    if (takes_long(pair, asked))
        return;
    const Expected hoped = expected(pair, asked);
    const Phase before = pair->phase;
    begin(false);
    short_of_memory = false;
    const bool told = !asked->nobody && (pair->unit->log_categories & LOG_ERRORS);
    const Answer answer = perform(pair->unit, asked);
    fail_in = 0;
    const bool error = answer.status == fmi2Error;
    must(error || answer.status <= fmi2Discard, "no such status");
    must(hoped != BAD || error, "not refused");
    must(hoped != GOOD || !error || short_of_memory, "refused");
    if (told && asked->call != CALL_SetDebugLogging)
        must(error == (errors_told > 0), "an error without a message, or a message without an error");
    if (!asked->nobody)
        follow(pair, asked, &answer);
    results_are_finite(pair, asked, &answer);
    const bool nothing_happened =
        error && (hoped == BAD || short_of_memory || (asked->call == CALL_DoStep && pair->phase == before));
    if (depth > 0 || nothing_happened)
        return;
    begin(true);
    const Answer other = perform(pair->twin, asked);
    must(memcmp(&answer, &other, sizeof answer) == 0, "the twin answers otherwise");
}

/* --- states */

typedef struct Image {
    fmi2Byte *bytes;
    size_t size;
} Image;

/* NULL where there is none to be had: outputs that are computed late are not finite. */
static Image image_of(Unit *unit) {
    fmi2FMUstate state = NULL;
    Image image = {NULL, 0};
    doing = "fmi2SerializeFMUstate";
    calls_made += 3;
    if (fmi2GetFMUstate(unit, &state) != fmi2OK) {
        must(MODEL.show_late != NULL && state == NULL, "no state");
        return image;
    }
    must(fmi2SerializedFMUstateSize(unit, state, &image.size) == fmi2OK, "no size");
    image.bytes = malloc(image.size);
    must(image.bytes != NULL && fmi2SerializeFMUstate(unit, state, image.bytes, image.size) == fmi2OK, "no bytes");
    must(fmi2FreeFMUstate(unit, &state) == fmi2OK && state == NULL, "not freed");
    return image;
}

static bool take_image(Unit *unit, Image image) {
    fmi2FMUstate state = NULL;
    doing = "fmi2DeSerializeFMUstate";
    calls_made += 2;
    const bool good = fmi2DeSerializeFMUstate(unit, image.bytes, image.size, &state) == fmi2OK &&
                      fmi2SetFMUstate(unit, state) == fmi2OK;
    must(fmi2FreeFMUstate(unit, &state) == fmi2OK && state == NULL, "not freed");
    return good;
}

/* All that can be read of the outputs. */
static void look(Pair *pair) {
    const Unit *unit = pair->unit;
    fmi2ValueReference outputs[MOST];
    int orders[MOST];
    double room[MOST];
    Asked asked = {.kind = KIND_REAL, .references = outputs, .orders = orders, .reals = room};
    for (fmi2ValueReference reference = 0; reference < unit->variable_count && asked.count < MOST; reference++) {
        const VariableInfo *info = unit->variables[reference].info;
        orders[asked.count] = 1;
        if (info->kind == KIND_REAL && info->causality == CAUSALITY_output)
            outputs[asked.count++] = reference;
    }
    asked.knowns = unit->inputs;
    for (const Call *call = (const Call[]){CALL_GetReal, CALL_GetRealOutputDerivatives, CALL_GetDirectionalDerivative};
         asked.call != CALL_GetDirectionalDerivative; call++) {
        asked.call = *call;
        asked.known_count = *call != CALL_GetDirectionalDerivative ? 0
                            : unit->input_count < MOST             ? unit->input_count
                                                                   : MOST;
        ask(pair, &asked);
    }
}

static void compare(Pair *pair) {
    if (depth > 0)
        return;
    look(pair);
    begin(false);
    Image own = image_of(pair->unit);
    begin(true);
    Image other = image_of(pair->twin);
    doing = "comparison";
    must(own.size == other.size && (own.size == 0 || memcmp(own.bytes, other.bytes, own.size) == 0),
         "the twin is in another state");
    free(own.bytes);
    free(other.bytes);
}

static void put_double(fmi2Byte *bytes, double value) {
    memcpy(bytes, &value, sizeof value);
}

/* Contents that somebody made up, under a checksum that fits. */
static void forge(Pair *pair) {
    Image image = image_of(pair->unit);
    Snapshot heading;
    if (image.bytes == NULL)
        return;
    for (unsigned count = 1 + byte() % 4; count > 0; count--) {
        const unsigned kind = byte() % 8;
        const size_t first = kind < 7 ? sizeof heading : 0, model = sizeof heading + pair->unit->state_at;
        const size_t from = kind % 2 && model + 8 < image.size ? model : first;
        const size_t place = from + (size_t)bytes(2) % (image.size - from);
        if (kind < 2)
            image.bytes[place] = (fmi2Byte)byte();
        else if (kind < 4 && place / 8 * 8 + 8 <= image.size)
            put_double(image.bytes + place / 8 * 8, number());
        else if (kind < 6)
            image.bytes[place / 4 * 4] = (fmi2Byte)byte(), image.bytes[place / 4 * 4 + 3] = (fmi2Byte)byte();
        else if (kind == 6)
            image.bytes[sizeof heading + offsetof(Header, phase) + byte() % 16] = (fmi2Byte)(byte() % 6);
        else
            image.bytes[place % sizeof heading] = (fmi2Byte)byte();
    }
    const uint64_t checksum = hash_bytes(HASH_OF_NOTHING, image.bytes + sizeof heading, image.size - sizeof heading);
    memcpy(image.bytes + offsetof(Snapshot, checksum), &checksum, sizeof checksum);
    if (byte() > 240)
        image.bytes = realloc(image.bytes, image.size = 1 + (size_t)bytes(2) % image.size);
    begin(false);
    if (take_image(pair->unit, image)) {
        pair->phase = (Phase)header_of(pair)->phase;
        pair->time = header_of(pair)->time;
        pair->stop = header_of(pair)->stop_time;
    }
    free(image.bytes);
}

static void act(Pair *pair);

/* Save, anything, restore. */
static void make_detour(Pair *pair, bool forged) {
    const Pair before = *pair;
    fmi2FMUstate state = NULL;
    if (depth == DEEPEST)
        return;
    begin(false);
    doing = "fmi2GetFMUstate";
    if (fmi2GetFMUstate(pair->unit, &state) != fmi2OK) {
        must(MODEL.show_late != NULL && state == NULL, "no state");
        return;
    }
    depth++;
    if (forged)
        forge(pair);
    for (unsigned count = byte() % 16; count > 0; count--)
        act(pair);
    depth--;
    begin(false);
    doing = "fmi2SetFMUstate";
    fail_in = byte() > 200 ? 1 + byte() % 4 : 0;
    bool good = fmi2SetFMUstate(pair->unit, state) == fmi2OK;
    must(good || fail_in == 0, "refused");
    if (!good) {
        good = fmi2SetFMUstate(pair->unit, state) == fmi2OK; /* memory is there again */
        must(good, "refused, with memory");
    }
    fail_in = 0;
    *pair = before;
    doing = "fmi2GetFMUstate again";
    if (byte() > 128)
        must(fmi2GetFMUstate(pair->unit, &state) == fmi2OK, "refused");
    must(fmi2FreeFMUstate(pair->unit, &state) == fmi2OK && state == NULL, "not freed");
    compare(pair);
}

/* The instance goes on in another one, by bytes. */
static void move(Pair *pair) {
    Image image = image_of(pair->unit);
    if (image.bytes == NULL)
        return;
    fmi2FreeInstance(pair->unit);
    pair->unit = instantiate(false);
    must(pair->unit != NULL, "the same again is refused");
    must(take_image(pair->unit, image), "its own state is refused");
    free(image.bytes);
    compare(pair);
}

/* After a reset an instance is as a new one. */
static void renew(Pair *pair) {
    const Asked reset = {.call = CALL_Reset};
    const unsigned which = byte() % 2;
    must(perform(which ? pair->unit : pair->twin, &reset).status == fmi2OK, "refused");
    Unit **other = which ? &pair->twin : &pair->unit;
    fmi2FreeInstance(*other);
    *other = instantiate(which);
    must(*other != NULL, "the same again is refused");
    at_its_start(pair);
    compare(pair);
}

/* --- actions */

static void set_inputs(Pair *pair, Call call) {
    const size_t count = pair->unit->input_count < MOST ? pair->unit->input_count : MOST;
    Asked asked = {.call = call, .kind = KIND_REAL, .count = count};
    asked.references = LAST(reference_room[0], count);
    asked.reals = LAST(real_room, count);
    asked.orders = LAST(order_room, count);
    for (size_t i = 0; i < count; i++) {
        LAST(reference_room[0], count)[i] = pair->unit->inputs[i];
        LAST(real_room, count)[i] = number();
        LAST(order_room, count)[i] = 1;
    }
    ask(pair, &asked);
}

/* One variable that can be set before the initialisation, mostly to something that it may be. */
static void set_variable(Pair *pair) {
    const Unit *unit = pair->unit;
    fmi2ValueReference reference = unit->variable_count > 0 ? byte() % (unsigned)unit->variable_count : 0;
    size_t left = unit->variable_count;
    while (left > 0 && !settable_in(PHASE_INSTANTIATED, unit->variables[reference].info)) {
        reference = (reference + 1) % (fmi2ValueReference)unit->variable_count;
        left--;
    }
    if (left == 0)
        return;
    const Kind kind = unit->variables[reference].info->kind;
    double real = kind == KIND_REAL ? some_real(unit, reference) : 0;
    int whole = kind == KIND_REAL ? 0 : (int)byte() % 4;
    fmi2String text = kind == KIND_STRING ? some_text() : "";
    const Asked asked = {.call = (Call)(CALL_SetReal + (int)kind),
                         .kind = kind,
                         .count = 1,
                         .references = &reference,
                         .reals = &real,
                         .wholes = &whole,
                         .texts = &text};
    ask(pair, &asked);
}

static void step(Pair *pair) {
    const double h = some_step(pair);
    for (unsigned count = 1 + byte() % 8; count > 0; count--) {
        const Asked asked = {.call = CALL_DoStep, .t = pair->time, .h = h};
        ask(pair, &asked);
    }
}

static void plainly(Pair *pair, Call call) {
    const Asked asked = {.call = call};
    ask(pair, &asked);
}

static void initialise(Pair *pair) {
    if (pair->phase == PHASE_INSTANTIATED)
        plainly(pair, CALL_EnterInitializationMode);
    if (pair->phase == PHASE_INITIALIZATION)
        plainly(pair, CALL_ExitInitializationMode);
}

/* Another life: of the twin as well, unless this is a detour. */
static void begin_anew(Pair *pair) {
    plainly(pair, CALL_Reset);
    for (unsigned count = byte() % 4; count > 0; count--)
        set_variable(pair);
    initialise(pair);
}

/* Arguments that no importer should give; whatever comes of it is freed. */
static void instantiate_oddly(void) {
    static char text[80];
    char given[GUID_SIZE + 1] = "", location[2 * PATH_ROOM];
    snprintf(given, sizeof given, "%s", guid);
    for (unsigned i = 0, length = byte() % sizeof text; i < sizeof text; i++)
        text[i] = (char)(i < length ? byte() : 0);
    const unsigned kind = byte();
    if (kind % 4 == 0)
        given[byte() % GUID_SIZE] = (char)byte();
    snprintf(location, sizeof location, "%s%s", kind % 8 < 4 ? "file://" : "", folder);
    const fmi2String names[] = {"tried%s#1#", "tried%s#1#", "tried%s#1#", NULL, ""};
    const fmi2String locations[] = {location, text, NULL, ""};
    doing = "fmi2Instantiate, oddly";
    begin(false);
    fail_in = 0;
    short_of_memory = true; /* names may be other ones */
    fmi2Component c = fmi2Instantiate(names[byte() % 5], byte() < 200 ? fmi2CoSimulation : (fmi2Type)(byte() % 3),
                                      kind == 255 ? NULL : given, locations[byte() % 4],
                                      kind == 254 ? NULL : &callbacks, fmi2False, kind % 2);
    must((c == NULL) == (errors_told > 0) || kind == 254, "refused without an error, or made with one");
    fmi2FreeInstance(c);
}

static void ask_for_states_oddly(Pair *pair, Call call) {
    fmi2FMUstate state = NULL;
    fmi2Byte room[8];
    size_t size = 0;
    doing = call_name(call);
    begin(false);
    const fmi2Component c = byte() < 200 ? pair->unit : NULL;
    if (c != NULL && fmi2GetFMUstate(c, &state) != fmi2OK)
        return;
    fmi2Status status = fmi2Error;
    if (call == CALL_GetFMUstate)
        status = fmi2GetFMUstate(c, NULL);
    else if (call == CALL_SetFMUstate)
        status = fmi2SetFMUstate(c, NULL);
    else if (call == CALL_SerializedFMUstateSize)
        status = byte() % 2 ? fmi2SerializedFMUstateSize(c, NULL, &size) : fmi2SerializedFMUstateSize(c, state, NULL);
    else if (call == CALL_SerializeFMUstate)
        status = fmi2SerializeFMUstate(c, byte() < 128 ? NULL : state, byte() < 128 ? NULL : room, sizeof room);
    else if (call == CALL_DeSerializeFMUstate)
        status = fmi2DeSerializeFMUstate(c, byte() < 128 ? NULL : room, 0, byte() < 128 ? NULL : &state);
    must(status == fmi2Error, "not refused");
    must(c == NULL || (fmi2FreeFMUstate(c, &state) == fmi2OK && fmi2FreeFMUstate(c, &state) == fmi2OK), "not freed");
}

static void call_anything(Pair *pair) {
    Call call = (Call)(byte() % CALL_COUNT);
    if (call == CALL_Instantiate || call == CALL_FreeInstance) {
        instantiate_oddly();
        return;
    }
    if (call >= CALL_GetFMUstate && call <= CALL_DeSerializeFMUstate) {
        ask_for_states_oddly(pair, call);
        return;
    }
    if ((call == CALL_Terminate || call == CALL_Reset) && byte() < 192)
        call = CALL_DoStep; /* or nothing would be far from the start */
    const Asked asked = some_call(pair, call);
    ask(pair, &asked);
}

static void act(Pair *pair) {
    switch (byte() % 16) {
    case 0:
    case 1:
    case 2:
        step(pair);
        break;
    case 3:
    case 4:
        set_inputs(pair, CALL_SetReal);
        break;
    case 5:
        set_inputs(pair, CALL_SetRealInputDerivatives);
        break;
    case 6:
        initialise(pair);
        break;
    case 7:
        make_detour(pair, false);
        break;
    case 8:
        make_detour(pair, true);
        break;
    case 9:
        fail_in = 1 + byte() % 6;
        call_anything(pair);
        fail_in = 0;
        break;
    case 10:
        if (depth == 0 && byte() % 4 == 0)
            move(pair);
        else
            compare(pair);
        break;
    case 11:
        if (depth == 0 && byte() % 4 == 0)
            renew(pair);
        else if (depth > 0 || byte() % 4 == 0)
            begin_anew(pair);
        break;
    case 12:
        set_variable(pair);
        break;
    default:
        call_anything(pair);
        break;
    }
}

/* Allocations fail one after the other until the instance can be made. */
static void make_in_short_memory(void) {
    Unit *unit = NULL;
    for (long n = 1; unit == NULL && n < 100; n++) {
        fail_in = n;
        unit = instantiate(false);
        if (fail_in > 0)
            break;                                         /* there was memory enough, whatever came of it */
        must(unit != NULL || held == 0, "memory is lost"); /* made: it went without a file that need not be there */
    }
    fail_in = 0;
    fmi2FreeInstance(unit);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
    at = data;
    end = data + size;
    depth = 0;
    fail_in = 0;
    choose_resources();
    if (byte() > 250)
        make_in_short_memory();
    bool made = make_pair(&pairs[0]);
    Pair *pair = &pairs[0];
    while (made && at < end) {
        const unsigned other = byte();
        if (other > 240) { /* two pairs take turns: none has anything to do with the other */
            pair = &pairs[pair == &pairs[0]];
            made = pair->unit != NULL || make_pair(pair);
            must(made, "the same again is refused");
        }
        act(pair);
    }
    for (pair = pairs; pair < pairs + PAIRS; pair++) {
        if (pair->unit != NULL)
            compare(pair);
        free_pair(pair);
    }
    doing = "the end";
    must(held == 0, "memory is lost");
    return 0;
}

/* Bytes as calls: whatever an importer may do to a unit, legal or not, from what a fuzzer makes up.
 *
 *   LLVMFuzzerTestOneInput(data, size)   for libFuzzer, or for driver.c where the compiler has none
 *
 * Compiled together with the sources of one unit; RESOURCES is the folder of its files.
 * Every instance has a twin. Both get the same calls, but the twin none of the detours: what was refused, what an
 * allocation failed in, and everything between saving a state and restoring it. Whatever can be read of the two must
 * remain the same to the last bit. Every status is held against what the table of variables and the state of the
 * instance say of the call. */
#include "calls.h"

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
        if (info->kind == KIND_REAL && info->causality == CAUSALITY_output) {
            outputs[asked.count++] = reference;
        }
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
    if (depth > 0) {
        return;
    }
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
    if (image.bytes == NULL) {
        return;
    }
    for (unsigned count = 1 + byte() % 4; count > 0; count--) {
        const unsigned kind = byte() % 8;
        const size_t first = kind < 7 ? sizeof heading : 0, model = sizeof heading + pair->unit->state_at;
        const size_t from = kind % 2 && model + 8 < image.size ? model : first;
        const size_t place = from + (size_t)bytes(2) % (image.size - from);
        if (kind < 2) {
            image.bytes[place] = (fmi2Byte)byte();
        } else if (kind < 4 && place / 8 * 8 + 8 <= image.size) {
            put_double(image.bytes + place / 8 * 8, number());
        } else if (kind < 6) {
            image.bytes[place / 4 * 4] = (fmi2Byte)byte(), image.bytes[place / 4 * 4 + 3] = (fmi2Byte)byte();
        } else if (kind == 6) {
            image.bytes[sizeof heading + offsetof(Header, phase) + byte() % 16] = (fmi2Byte)(byte() % 6);
        } else {
            image.bytes[place % sizeof heading] = (fmi2Byte)byte();
        }
    }
    const uint64_t checksum = hash_bytes(HASH_OF_NOTHING, image.bytes + sizeof heading, image.size - sizeof heading);
    memcpy(image.bytes + offsetof(Snapshot, checksum), &checksum, sizeof checksum);
    if (byte() > 240) {
        image.bytes = realloc(image.bytes, image.size = 1 + (size_t)bytes(2) % image.size);
    }
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
    if (depth == DEEPEST) {
        return;
    }
    begin(false);
    doing = "fmi2GetFMUstate";
    if (fmi2GetFMUstate(pair->unit, &state) != fmi2OK) {
        must(MODEL.show_late != NULL && state == NULL, "no state");
        return;
    }
    depth++;
    if (forged) {
        forge(pair);
    }
    for (unsigned count = byte() % 16; count > 0; count--) {
        act(pair);
    }
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
    if (byte() > 128) {
        must(fmi2GetFMUstate(pair->unit, &state) == fmi2OK, "refused");
    }
    must(fmi2FreeFMUstate(pair->unit, &state) == fmi2OK && state == NULL, "not freed");
    compare(pair);
}

/* The instance goes on in another one, by bytes. */
static void move(Pair *pair) {
    Image image = image_of(pair->unit);
    if (image.bytes == NULL) {
        return;
    }
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
    if (left == 0) {
        return;
    }
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
    if (pair->phase == PHASE_INSTANTIATED) {
        plainly(pair, CALL_EnterInitializationMode);
    }
    if (pair->phase == PHASE_INITIALIZATION) {
        plainly(pair, CALL_ExitInitializationMode);
    }
}

/* Another life: of the twin as well, unless this is a detour. */
static void begin_anew(Pair *pair) {
    plainly(pair, CALL_Reset);
    for (unsigned count = byte() % 4; count > 0; count--) {
        set_variable(pair);
    }
    initialise(pair);
}

/* Arguments that no importer should give; whatever comes of it is freed. */
static void instantiate_oddly(void) {
    static char text[80];
    char given[GUID_SIZE + 1] = "", location[2 * PATH_ROOM];
    snprintf(given, sizeof given, "%s", guid);
    for (unsigned i = 0, length = byte() % sizeof text; i < sizeof text; i++) {
        text[i] = (char)(i < length ? byte() : 0);
    }
    const unsigned kind = byte();
    if (kind % 4 == 0) {
        given[byte() % GUID_SIZE] = (char)byte();
    }
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
    if (c != NULL && fmi2GetFMUstate(c, &state) != fmi2OK) {
        return;
    }
    fmi2Status status = fmi2Error;
    if (call == CALL_GetFMUstate) {
        status = fmi2GetFMUstate(c, NULL);
    } else if (call == CALL_SetFMUstate) {
        status = fmi2SetFMUstate(c, NULL);
    } else if (call == CALL_SerializedFMUstateSize) {
        status = byte() % 2 ? fmi2SerializedFMUstateSize(c, NULL, &size) : fmi2SerializedFMUstateSize(c, state, NULL);
    } else if (call == CALL_SerializeFMUstate) {
        status = fmi2SerializeFMUstate(c, byte() < 128 ? NULL : state, byte() < 128 ? NULL : room, sizeof room);
    } else if (call == CALL_DeSerializeFMUstate) {
        status = fmi2DeSerializeFMUstate(c, byte() < 128 ? NULL : room, 0, byte() < 128 ? NULL : &state);
    }
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
    if ((call == CALL_Terminate || call == CALL_Reset) && byte() < 192) {
        call = CALL_DoStep; /* or nothing would be far from the start */
    }
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
        if (depth == 0 && byte() % 4 == 0) {
            move(pair);
        } else {
            compare(pair);
        }
        break;
    case 11:
        if (depth == 0 && byte() % 4 == 0) {
            renew(pair);
        } else if (depth > 0 || byte() % 4 == 0) {
            begin_anew(pair);
        }
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
        if (fail_in > 0) {
            break; /* there was memory enough, whatever came of it */
        }
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
    if (byte() > 250) {
        make_in_short_memory();
    }
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
        if (pair->unit != NULL) {
            compare(pair);
        }
        free_pair(pair);
    }
    doing = "the end";
    must(held == 0, "memory is lost");
    return 0;
}

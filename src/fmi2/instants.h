/* Sample instants t_k = start + k T_c that are counted, against communication steps of any size. */
#ifndef FEEDSIM_INSTANTS_H
#define FEEDSIM_INSTANTS_H

#include <float.h>
#include <math.h>
#include <stdbool.h>
#include <stdint.h>

#include "numbers.h"
#include "unit.h"

/* An importer's sum of steps runs off the grid: adding 125 us ten million times ends 1.6e-3 cycles late. An instant
 * that lies so little ahead of the end of a step belongs to the next one, as it was meant; reading the inputs a
 * hundredth of a cycle late instead (extrapolated by the slope) is far below a cycle's own effect. In parts of the
 * cycle or of the step, whichever is shorter: an instant at the start of a step is worked in that step, however short.
 * Steps much shorter than a cycle may drift further than that. Then an instant is worked one of them early, still with
 * its inputs run on to t_k; instants are counted, so that none is skipped or worked twice. */
#define INSTANTS_DRIFT 1e-2

/* A clock that runs since t has no finer grain than this [parts of t], a few units in the last place. */
#define INSTANTS_GRAIN (16 * DBL_EPSILON)

/* More instants in one step are taken for a mistake: the unit would not come back for minutes. */
#define INSTANTS_MOST 1e9

/* Instants are counted up to here, where doubles can still tell them apart; 285 years of the shortest cycle. */
#define INSTANTS_COUNTED ((int64_t)1 << 53)

/* An end of a step so close to the end of a cycle [T_c] is the end of the cycle. */
#define INSTANTS_ROUNDING 1e-6

/* How far ahead of the end of a step from t to t + h an instant belongs to the next step [s]. */
static inline double instants_margin(double t, double h, double T_c) {
    const double part = INSTANTS_DRIFT * (T_c < h ? T_c : h), grain = INSTANTS_GRAIN * (fabs(t) + h);
    const double drift = part > grain ? part : grain;
    return drift < 0.5 * h ? drift : 0.5 * h; /* steps of a few grains */
}

/* Refuses a step that would hold `count` instants, T_c apart; false, with the reason logged. */
static inline bool instants_too_many(Unit *unit, double count, double T_c) {
    char text[3][NUMBER_TEXT_SIZE];
    return unit_fail(unit,
                     "the step would hold %s sample instants, T_c = %s s apart; allowed are at most %.0e, which is a "
                     "step of %s s",
                     number_text(text[0], ceil(count)), number_text(text[1], T_c), INSTANTS_MOST,
                     number_text(text[2], INSTANTS_MOST * T_c));
}

/* Whether that many instants, T_c apart, are what a clock that was stepped in any way has behind it: each lies ahead of
 * the clock, and the next one is at most the margin behind it; false, with the reason logged. */
static inline bool instants_agree(Unit *unit, Clock clock, int64_t count, double T_c) {
    const double grain = 4 * INSTANTS_GRAIN * (fabs(clock.start) + fabs(clock.time));
    const double next = clock.start + (double)count * T_c;
    if (!clock.valid || (next >= clock.time - INSTANTS_DRIFT * T_c - grain && next - T_c <= clock.time + grain)) {
        return true;
    }
    char text[3][NUMBER_TEXT_SIZE];
    return unit_fail(
        unit,
        "the state contradicts itself: it has %.0f sample instants, T_c = %s s apart, behind it since %s s, "
        "and stands at %s s",
        (double)count, number_text(text[0], T_c), number_text(text[1], clock.start), number_text(text[2], clock.time));
}

/* Share [1] of the cycle, the last one begun, that lies behind where its end, t_k, is `ahead` [s] of the step's. */
static inline double instants_share(double ahead, double T_c) {
    return ahead < INSTANTS_ROUNDING * T_c ? 1.0 : fmax(1.0 - ahead / T_c, 0.0);
}

#endif

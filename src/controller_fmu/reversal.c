#include "reversal.h"

#include <math.h>

static const double STANDSTILL = 1e-12; /* m in a cycle: what rounding makes of a setpoint that stands */

double reversal_step(ReversalState *x, double resolution, double way) {
    if (!(fabs(x->direction) > 0.0)) {
        x->back += way;
        if (fabs(x->back) > resolution) {
            x->direction = x->back > 0.0 ? 1.0 : -1.0;
            x->back = 0.0;
        }
        return 0.0;
    }
    const double backwards = -x->direction * way;
    x->samples = !(backwards > STANDSTILL) ? 0 : x->back > 0.0 ? x->samples + 1 : 1;
    x->back = fmax(0.0, x->back + backwards);
    if (!(x->back > resolution)) {
        return 0.0;
    }
    const double back = x->back;
    x->direction = -x->direction;
    x->back = 0.0;
    return back;
}

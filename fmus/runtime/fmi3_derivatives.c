/* FMI 3.0: partial derivatives. */
#include "derivatives.h"
#include "fmi.h"

#define ARGUMENTS                                                                                                   \
    fmi3Instance handle, const fmi3ValueReference unknowns[], size_t n_unknowns, const fmi3ValueReference knowns[], \
        size_t n_knowns, const fmi3Float64 seed[], size_t n_seed, fmi3Float64 sensitivity[], size_t n_sensitivity

fmi3Status fmi3GetDirectionalDerivative(ARGUMENTS) {
    return (fmi3Status)get_derivative(handle, __func__, false, unknowns, n_unknowns, knowns, n_knowns, seed, n_seed,
                                      sensitivity, n_sensitivity);
}

fmi3Status fmi3GetAdjointDerivative(ARGUMENTS) {
    return (fmi3Status)get_derivative(handle, __func__, true, unknowns, n_unknowns, knowns, n_knowns, seed, n_seed,
                                      sensitivity, n_sensitivity);
}

/* Partial derivatives of the real outputs by the real inputs. */
#ifndef DERIVATIVES_H
#define DERIVATIVES_H

#include "instance.h"

/* J seed of the real outputs `unknowns` by the real inputs `knowns`; `adjoint` gives seed J instead. */
Status get_derivative(Instance *instance, const char *function, bool adjoint, const uint32_t unknowns[], size_t n_unknowns,
                      const uint32_t knowns[], size_t n_knowns, const double seed[], size_t n_seed,
                      double sensitivity[], size_t n_sensitivity);

#endif

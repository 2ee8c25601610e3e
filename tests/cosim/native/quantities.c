/* y = u for an angle, a length and a temperature: in degrees, mm and degrees Celsius, and in SI units. */
#include "frame/unit.h"

typedef struct {
    double angle_in, length_in, temperature_in, angle, length, temperature;
} Quantities;

#define VARIABLES(angle_unit, length_unit, temperature_unit)                                                           \
    {                                                                                                                  \
        {"angle_in", INPUT, REAL, offsetof(Quantities, angle_in), .unit = angle_unit},                                 \
        {"length_in", INPUT, REAL, offsetof(Quantities, length_in), .unit = length_unit},                              \
        {"temperature_in", INPUT, REAL, offsetof(Quantities, temperature_in), .unit = temperature_unit},               \
        {"angle", OUTPUT, REAL, offsetof(Quantities, angle), .unit = angle_unit, .depends = "angle_in"},               \
        {"length", OUTPUT, REAL, offsetof(Quantities, length), .unit = length_unit, .depends = "length_in"},           \
        {"temperature", OUTPUT, REAL, offsetof(Quantities, temperature), .unit = temperature_unit,                     \
         .depends = "temperature_in"},                                                                                 \
    }
static const Variable in_workshop_units[] = VARIABLES("deg", "mm", "degC");
static const Variable in_si_units[] = VARIABLES("rad", "m", "K");

static void outputs(Unit *unit) {
    SELF(Quantities);
    self->angle = self->angle_in;
    self->length = self->length_in;
    self->temperature = self->temperature_in;
}

static const Model workshop = {
    "workshop", in_workshop_units, COUNT(in_workshop_units), 0.1, 0, sizeof(Quantities), .outputs = outputs,
};
static const Model si = {"si", in_si_units, COUNT(in_si_units), 0.1, 0, sizeof(Quantities), .outputs = outputs};
UNIT(workshop)
UNIT(si)

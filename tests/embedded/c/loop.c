/* An exported controller holds the simulator that was exported of the same model: main gives 0 if the output gets there. */
#include <math.h>

#include "model.h"
#include "plant.h"

#define SAMPLES 600

int main(void) {
    const float wanted[1] = {340.0F};
    float y[1] = {0.0F};
    float u[1] = {0.0F};
    plant_state plant;
    model_state controller;
    int wrong = 0;
    plant_init(&plant);
    model_init(&controller);
    for (int sample = 0; sample < SAMPLES; sample++) {
        plant_step(&plant, u, y);
        model_control(&controller, wanted, y, u);
        wrong |= !(u[0] >= 0.0F && u[0] <= 100.0F);
    }
    return wrong || !(fabsf(y[0] - wanted[0]) < 0.05F);
}

/* From power-up to main, and from its return to the end of the emulator, for programs in C with newlib. */
#include <stdint.h>
#include <stdlib.h>

extern uint32_t stack, bss_start, bss_end;
extern void initialise_monitor_handles(void);
extern int main(void);

/* Turns the floating-point unit on, which is coprocessors 10 and 11, and clears what has no value. */
void reset(void);

void reset(void) {
    *(volatile uint32_t *)0xe000ed88 |= 0xf00000;
    __asm volatile("dsb\n isb");
    for (uint32_t *word = &bss_start; word < &bss_end; word++) {
        *word = 0;
    }
    initialise_monitor_handles();
    exit(main());
}

static void fault(void) {
    _Exit(1);
}

/* The first stack pointer, where the processor goes on reset, and on its first five faults. */
__attribute__((section(".vectors"), used)) static const struct {
    void *stack;
    void (*handlers[6])(void);
} vectors = {&stack, {reset, fault, fault, fault, fault, fault}};

/* The C library calls them around main. */
void _init(void) {}
void _fini(void) {}

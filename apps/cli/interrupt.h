#pragma once

#include <atomic>

namespace etendue {

/// From now on Ctrl-C or SIGTERM set the flag that this returns; the second one ends the program.
const std::atomic<bool>& catch_interrupts();

/// Flags that Ctrl-C and SIGTERM set.
struct Interrupts {
    const std::atomic<bool>& stop;  ///< By the first one: end after the work in flight.
    const std::atomic<bool>& drop;  ///< By the second, or when the grace is over: leave that work.
};
/// From now on they set these flags; the third one ends the program. `grace`: seconds from the first one on.
Interrupts catch_interrupts(unsigned grace);

}  // namespace etendue

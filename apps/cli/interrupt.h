#pragma once

#include <atomic>

namespace etendue {

/// Handles SIGINT (Ctrl-C) and SIGTERM from now on: the first signal sets the returned flag, the second ends the
/// program.
const std::atomic<bool>& catch_interrupts();

/// Flags set by SIGINT (Ctrl-C) and SIGTERM.
struct Interrupts {
    const std::atomic<bool>& stop;  ///< Set by the first signal: finish the current work, then end.
    const std::atomic<bool>&
        drop;  ///< Set by the second signal or after `grace`: abandon that work.
};
/// Handles both signals from now on by setting these flags; a further signal once `drop` is set ends the program.
/// `grace`: seconds after the first signal.
Interrupts catch_interrupts(unsigned grace);

}  // namespace etendue

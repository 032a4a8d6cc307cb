#pragma once

#include <atomic>

namespace etendue {

/// From now on Ctrl-C or SIGTERM set the flag that this returns; the second one ends the program.
const std::atomic<bool>& catch_interrupts();

}  // namespace etendue

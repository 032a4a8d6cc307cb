#include "interrupt.h"

#include <csignal>
#include <cstdlib>

namespace etendue {
namespace {

std::atomic<bool> interrupted{false};

extern "C" void on_interrupt(int) {
    if (interrupted.exchange(true)) std::_Exit(130);
}

}  // namespace

const std::atomic<bool>& catch_interrupts() {
    std::signal(SIGINT, on_interrupt);
    std::signal(SIGTERM, on_interrupt);
    return interrupted;
}

}  // namespace etendue

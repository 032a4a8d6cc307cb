#include "interrupt.h"

#include <csignal>
#include <cstdlib>

#include <unistd.h>

namespace etendue {
namespace {

// Globals, since a signal handler has no argument through which to reach them.
std::atomic<bool> stop{false}, drop{false}, is_graceful{false};
std::atomic<unsigned> grace_seconds{0};

extern "C" void on_interrupt(int) {
    if (!stop.exchange(true)) {
        if (!is_graceful) return;
        if (grace_seconds > 0)
            alarm(grace_seconds);
        else
            drop = true;
    } else if (!is_graceful || drop.exchange(true)) {
        std::_Exit(130);
    }
}
extern "C" void on_end_of_grace(int) {
    drop = true;
}

}  // namespace

const std::atomic<bool>& catch_interrupts() {
    std::signal(SIGINT, on_interrupt);
    std::signal(SIGTERM, on_interrupt);
    return stop;
}

Interrupts catch_interrupts(unsigned grace) {
    grace_seconds = grace;
    is_graceful = true;
    std::signal(SIGALRM, on_end_of_grace);
    return {catch_interrupts(), drop};
}

}  // namespace etendue

#include "interrupt.h"

#include <csignal>
#include <cstdlib>

#include <unistd.h>

#include "system/child_process.h"
#include "system/output_file.h"

namespace etendue {
namespace {

// Globals, since a signal handler has no argument through which to reach them.
std::atomic<bool> stop{false}, drop{false}, is_graceful{false}, ends_at_once{false};
std::atomic<unsigned> grace_seconds{0};

// Temporary folders are removed by the thread that has made them.
extern "C" void on_interrupt(int signal) {
    if (HeldSignals::pass_on(signal)) return;
    if (ends_at_once) end_at_once(130);
    if (!stop.exchange(true)) {
        if (!is_graceful) return;
        if (grace_seconds > 0)
            alarm(grace_seconds);
        else
            drop = true;
    } else if (!is_graceful || drop.exchange(true)) {
        end_at_once(130);
    }
}
extern "C" void on_end(int signal) {
    if (HeldSignals::pass_on(signal)) return;
    if (signal == SIGINT) end_at_once(130);
    remove_temporary_files();
    std::signal(signal, SIG_DFL);
    std::raise(signal);
}
extern "C" void on_end_of_grace(int) {
    drop = true;
}

void handle_all(void (*handler)(int)) {
    std::signal(SIGINT, handler);
    std::signal(SIGTERM, handler);
    // nohup asks not to be told.
    if (std::signal(SIGHUP, handler) == SIG_IGN) std::signal(SIGHUP, SIG_IGN);
}

}  // namespace

void end_by_signals() {
    handle_all(on_end);
    std::signal(SIGXFSZ, SIG_IGN);
}

void end_at_once(int status) {
    remove_temporary_files();
    std::_Exit(status);
}

EndsAtOnce::EndsAtOnce() {
    ends_at_once = true;
    // A signal that came just before.
    if (stop) end_at_once(130);
}

EndsAtOnce::~EndsAtOnce() {
    ends_at_once = false;
}

const std::atomic<bool>& catch_interrupts() {
    handle_all(on_interrupt);
    std::signal(SIGPIPE, SIG_IGN);
    return stop;
}

Interrupts catch_interrupts(unsigned grace) {
    grace_seconds = grace;
    is_graceful = true;
    std::signal(SIGALRM, on_end_of_grace);
    return {catch_interrupts(), drop};
}

void catch_signal_of_mpirun() {
    std::signal(SIGUSR1, on_interrupt);
}

}  // namespace etendue

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
/// Handled by on_interrupt(). The time of grace is none of them, though it ends like the second one.
std::atomic<int> signals{0};

// Temporary folders are removed by the thread that has made them.
extern "C" void on_interrupt(int signal) {
    if (HeldSignals::pass_on(signal)) return;
    if (ends_at_once) end_at_once(130);
    const int earlier = signals++;
    if (earlier > (is_graceful ? 1 : 0)) end_at_once(130);
    stop = true;
    if (earlier == 0 && is_graceful && grace_seconds > 0)
        alarm(grace_seconds);
    else if (is_graceful)
        drop = true;
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

void end_grace() {
    grace_seconds = 0;
    alarm(0);
}

void catch_signal_of_mpirun() {
    std::signal(SIGUSR1, on_interrupt);
}

}  // namespace etendue

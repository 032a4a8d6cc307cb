#pragma once

#include <atomic>

namespace etendue {

/// Called once at the start. Until one of the functions below is called, SIGINT (Ctrl-C), SIGTERM and SIGHUP (the
/// terminal was closed) end the program, with status 130 after SIGINT. No signal leaves temporary files. A file that
/// grows beyond a limit is an error of its writer, instead of a signal.
void end_by_signals();

/// Handles the three signals from now on: the first one sets the returned flag, the second ends the program. A pipe
/// that nobody reads any longer does not end it.
const std::atomic<bool>& catch_interrupts();

/// While one exists, a signal ends the program at once, as before catch_interrupts(). For work that has no result of its
/// own and cannot be stopped, such as loading a scene.
class EndsAtOnce {
public:
    EndsAtOnce();
    ~EndsAtOnce();
    EndsAtOnce(const EndsAtOnce&) = delete;
    EndsAtOnce& operator=(const EndsAtOnce&) = delete;
};

/// Ends the program without waiting for its other threads. No temporary files stay.
[[noreturn]] void end_at_once(int status);

/// Flags set by the three signals.
struct Interrupts {
    const std::atomic<bool>& stop;  ///< Set by the first signal: finish the current work, then end.
    const std::atomic<bool>&
        drop;  ///< Set by the second signal or after `grace`: abandon that work.
};
/// Handles the signals from now on by setting these flags; the third signal ends the program.
/// `grace`: seconds after the first signal.
Interrupts catch_interrupts(unsigned grace);
/// There is no work left that could be abandoned: no alarm interrupts what follows.
void end_grace();
/// Handles SIGUSR1 in the same way. mpirun passes this signal on at once.
void catch_signal_of_mpirun();

}  // namespace etendue

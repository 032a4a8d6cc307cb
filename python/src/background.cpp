#include <chrono>
#include <condition_variable>
#include <exception>
#include <mutex>
#include <thread>

#include "bindings.h"

namespace etendue::python {

struct Background::State {
    std::mutex mutex;
    std::condition_variable changed;
    const std::function<void()>* callback = nullptr;  ///< To be called.
    bool is_done = false;
    std::exception_ptr failure;
    std::exception_ptr ending;  ///< What end_task() was called with.
};

namespace {
thread_local Background* current = nullptr;  ///< The one whose task this thread runs.
}

void Background::call(const std::function<void()>& callback) {
    std::unique_lock lock(state_->mutex);
    state_->callback = &callback;
    state_->changed.notify_all();
    state_->changed.wait(lock, [&] { return !state_->callback; });
}

void Background::run(const std::function<void()>& task, const std::function<void()>& tick) {
    State state;
    state_ = &state;
    std::thread thread([&] {
        current = this;
        try {
            task();
        } catch (...) {
            state.failure = std::current_exception();
        }
        const std::scoped_lock lock(state.mutex);
        state.is_done = true;
        state.changed.notify_all();
    });
    std::exception_ptr raised;
    const auto guarded = [&](const std::function<void()>& call) {
        try {
            call();
        } catch (const nb::python_error& e) {
            // Ctrl-C may also arrive while a callback runs.
            if (e.matches(PyExc_KeyboardInterrupt))
                interrupted = true;
            else if (!raised)
                raised = std::current_exception();
            stop = drop = true;
        } catch (...) {
            if (!raised) raised = std::current_exception();
            stop = drop = true;
        }
    };
    bool is_done = false;
    while (!is_done) {
        const std::function<void()>* callback = nullptr;
        {
            nb::gil_scoped_release no_gil;
            std::unique_lock lock(state.mutex);
            state.changed.wait_for(lock, std::chrono::milliseconds(50),
                                   [&] { return state.callback || state.is_done; });
            callback = state.callback;
            is_done = state.is_done;
        }
        if (callback) {
            if (!stop) guarded(*callback);
            const std::scoped_lock lock(state.mutex);
            state.callback = nullptr;
            state.changed.notify_all();
        }
        guarded([&] {
            if (PyErr_CheckSignals() != 0) throw nb::python_error();
        });
        if (!stop) guarded(tick);
    }
    {
        nb::gil_scoped_release no_gil;
        thread.join();
    }
    state_ = nullptr;
    if (raised) std::rethrow_exception(raised);
    if (state.ending) std::rethrow_exception(state.ending);
    task_failed = state.failure != nullptr;
    if (state.failure) std::rethrow_exception(state.failure);
}

void Background::end_task() {
    if (!current) return;
    if (!current->state_->ending) current->state_->ending = std::current_exception();
    current->stop = current->drop = true;
}

}  // namespace etendue::python

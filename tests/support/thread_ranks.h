#pragma once
// Threads in the place of processes that render one image together.

#include <algorithm>
#include <barrier>
#include <functional>
#include <thread>
#include <vector>

#include "system/ranks.h"

namespace etendue::test {

class ThreadRanks final : public Ranks {
public:
    /// Calls `task(ranks)` in `count` threads. It must not throw.
    static void run(int count, const std::function<void(const Ranks&)>& task) {
        Group group(count);
        std::vector<std::thread> threads;
        for (int r = 0; r < count; ++r)
            threads.emplace_back([&group, &task, r] { task(ThreadRanks(group, r)); });
        for (std::thread& t : threads) t.join();
    }

    int count() const override { return int(group_.data.size()); }
    int index() const override { return index_; }

    void share(void* data, size_t size, std::span<const uint64_t> begins) const override {
        show(data, [&] {
            for (int r = 0; r < count(); ++r)
                if (r != index_) copy(at(r), size, begins, r, static_cast<std::byte*>(data));
        });
    }
    void distribute(const void* from, int senders, size_t size, std::span<const uint64_t> begins,
                    void* to) const override {
        show(from, [&] {
            const auto own = size_t(begins[size_t(index_) + 1] - begins[size_t(index_)]);
            for (int r = 0; r < senders; ++r)
                std::copy_n(at(r) + begins[size_t(index_)] * size, own * size,
                            static_cast<std::byte*>(to) + size_t(r) * own * size);
        });
    }
    void broadcast(std::vector<std::byte>& bytes, int from) const override {
        show(&bytes, [&] {
            if (index_ != from)
                bytes = *static_cast<const std::vector<std::byte>*>(group_.data[size_t(from)]);
        });
    }
    std::vector<std::string> gather(std::string_view said) const override {
        std::vector<std::string> all;
        show(&said, [&] {
            for (const void* other : group_.data)
                all.emplace_back(*static_cast<const std::string_view*>(other));
        });
        return all;
    }

private:
    struct Group {
        explicit Group(int count) : data(size_t(count)), barrier(count) {}
        std::vector<const void*> data;  ///< That each shows to the others.
        std::barrier<> barrier;
    };
    ThreadRanks(Group& group, int index) : group_(group), index_(index) {}

    /// Calls `look` while all others show their data, too.
    template <class Look>
    void show(const void* data, const Look& look) const {
        group_.data[size_t(index_)] = data;
        group_.barrier.arrive_and_wait();
        look();
        group_.barrier.arrive_and_wait();
    }
    const std::byte* at(int r) const {
        return static_cast<const std::byte*>(group_.data[size_t(r)]);
    }
    static void copy(const std::byte* from, size_t size, std::span<const uint64_t> begins, int r,
                     std::byte* to) {
        const uint64_t begin = begins[size_t(r)], end = begins[size_t(r) + 1];
        std::copy_n(from + begin * size, size_t(end - begin) * size, to + begin * size);
    }

    Group& group_;
    int index_;
};

}  // namespace etendue::test

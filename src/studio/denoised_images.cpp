#include "studio/denoised_images.h"

#include <algorithm>

#include <fmt/format.h>

#include "image/image.h"
#include "render/aov.h"
#include "studio/http.h"
#include "studio/request_values.h"
#include "system/failure.h"

namespace etendue {

using Clock = std::chrono::steady_clock;

DenoisedImages::DenoisedImages(Session& session, int threads)
    : session_(session), threads_(threads), thread_([this] { work(); }) {}

DenoisedImages::~DenoisedImages() {
    {
        const std::lock_guard lock(mutex_);
        is_ended_ = true;
    }
    wake_.notify_all();
    thread_.join();
}

std::optional<int> DenoisedImages::run_of(std::string_view view) {
    constexpr std::string_view kView = "denoised:";
    if (!view.starts_with(kView)) return {};
    return integer_of(view.substr(kView.size()), "denoised");
}

bool DenoisedImages::renders() const {
    const std::vector<RunStatus> runs = session_.runs();
    return std::any_of(runs.begin(), runs.end(), [](const RunStatus& s) {
        return s.state == RunState::Rendering || s.state == RunState::Stopping;
    });
}

std::shared_ptr<const Snapshot> DenoisedImages::ask(int run, uint64_t after) {
    const std::shared_ptr<const Snapshot> noisy = session_.snapshot(run);
    const bool must_rest = renders();
    std::string problem;
    {
        const std::lock_guard lock(mutex_);
        if (removed_.contains(run)) throw ApiError(422, fmt::format("run {} was removed", run));
        if (problem_run_ == run) problem.swap(problem_);
        const bool is_ours = image_ && image_->run == run;
        if (problem.empty() && noisy && noisy->passes > after &&
            (!is_ours || noisy->passes > image_->passes))
            wanted_ = run;
        if (!must_rest) next_ = {};
        if (problem.empty()) {
            wake_.notify_all();
            return is_ours ? image_ : nullptr;
        }
    }
    throw ApiError(422, problem);
}

std::shared_ptr<const Snapshot> DenoisedImages::of_run(int run) const {
    const std::lock_guard lock(mutex_);
    return image_ && image_->run == run ? image_ : nullptr;
}

void DenoisedImages::forget(int run) {
    const std::lock_guard lock(mutex_);
    removed_.insert(run);
    if (wanted_ == run) wanted_.reset();
    if (under_way_ == run) is_cancelled_ = true;
    if (image_ && image_->run == run) image_.reset();
}

// -- The thread.

void DenoisedImages::work() {
    std::unique_lock lock(mutex_);
    while (true) {
        wake_.wait(lock, [&] { return is_ended_ || wanted_; });
        while (!is_ended_ && wanted_ && Clock::now() < next_) wake_.wait_until(lock, next_);
        if (is_ended_) return;
        if (!wanted_) continue;
        under_way_ = *wanted_;
        wanted_.reset();
        is_cancelled_ = false;
        const int run = under_way_;
        lock.unlock();

        const Clock::time_point begin = Clock::now();
        std::shared_ptr<const Snapshot> image;
        std::string problem = failure_of([&] {
            try {
                image = denoised(run);
            } catch (const DenoisingCancelled&) {
            }
        });
        const auto rest =
            std::chrono::duration_cast<Clock::duration>(kRest * (Clock::now() - begin));

        lock.lock();
        under_way_ = 0;
        // A run that was removed in the meantime is no problem, and has no image.
        if (is_cancelled_) continue;
        next_ = Clock::now() + rest;
        if (!image && problem.empty()) continue;
        if (image) image_.swap(image);
        // Asked for during an attempt that failed, it would fail again.
        if (!problem.empty() && wanted_ == run) wanted_.reset();
        problem_.swap(problem);
        problem_run_ = run;
        ++version_;
    }
}

void DenoisedImages::make_guides(const std::shared_ptr<const Scene>& scene, int threads) {
    if (scene_of_guides_.lock() == scene) return;
    scene_of_guides_.reset();
    const size_t pixels = scene->film().pixel_count();
    albedo_.assign(pixels, Rgb());
    normal_.assign(pixels, Rgb());
    // One sample after the other, so that it can be cancelled.
    for (int i = 0; i < kAovSamples; ++i) {
        if (!goes_on()) throw DenoisingCancelled();
        const std::vector<AovImage> layers =
            render_aovs(*scene, {"denoise_albedo", "denoise_normal"}, 1, uint64_t(i), threads);
        for (size_t p = 0; p < pixels; ++p) {
            albedo_[p] += layers[0].pixels[p] / float(kAovSamples);
            normal_[p] += layers[1].pixels[p] / float(kAovSamples);
        }
    }
    scene_of_guides_ = scene;
}

std::shared_ptr<const Snapshot> DenoisedImages::denoised(int run) {
    std::shared_ptr<const Snapshot> noisy;
    std::shared_ptr<const Scene> scene;
    try {
        noisy = session_.snapshot(run);
        scene = session_.scene_of(run);
    } catch (const std::exception&) {
        throw DenoisingCancelled();  // The run was removed.
    }
    if (!noisy) return nullptr;
    if (const auto last = of_run(run); last && last->passes >= noisy->passes) return nullptr;
    if (!denoiser_) denoiser_ = std::make_unique<const Denoiser>();
    const int threads = renders() ? 1 : threads_;
    make_guides(scene, threads);
    const int w = noisy->width, h = noisy->height;
    Image image = rgb_image(w, h, noisy->mean);
    add_rgb_layer(image, w, h, "denoise_albedo", albedo_);
    add_rgb_layer(image, w, h, "denoise_normal", normal_);
    auto result = std::make_shared<Snapshot>();
    result->run = run;
    result->passes = noisy->passes;
    result->width = w;
    result->height = h;
    noisy.reset();  // Whose memory the session uses again.
    result->mean = rgb_pixels(denoiser_->denoise(image, threads, [this] { return goes_on(); }));
    return result;
}

}  // namespace etendue

#pragma once
// The protocol between page and session, version 1: JSON, and binary images and geometry.

#include <array>
#include <atomic>
#include <chrono>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include "image/image_io.h"
#include "mcmc/user_paths.h"
#include "session/session.h"
#include "session/workers.h"
#include "studio/denoised_images.h"
#include "studio/http.h"
#include "studio/opened_images.h"
#include "studio/scene_data.h"

namespace etendue {

/// What of the scene is rendered, in place of what its file and the command line say.
struct SceneView {
    std::string sensor;                      ///< As BuildOptions has it; empty: as it was.
    std::optional<std::array<int, 4>> crop;  ///< x, y, width and height, of the whole image.
    struct Camera {
        Vec3 eye, target, up;
    };
    std::optional<Camera> camera;  ///< Place and direction of the sensor.
};

struct ApiOptions {
    std::string token;
    std::string scene_file;
    std::string output_folder;          ///< Where images and paths are saved.
    std::optional<RgbImage> reference;  ///< Shown while it has the size of the image.
    /// By which the page may be asked for, beside localhost and addresses.
    std::vector<std::string> hosts;
    /// Changes what is loaded from the next Session::reload() on; empty: nothing can be changed.
    std::function<void(const SceneView&)> set_view = {};
    int threads = 0;  ///< That remove noise while no run renders; 0: one per core.
};

class Api final : public Handler {
public:
    Api(Session& session, ApiOptions options);
    /// Ends the replays that are under way.
    ~Api() override;

    Admission admit(const Request& request) override;
    void handle(Request request, std::function<void(Reply)> done) override;
    uint64_t revision() override;
    std::string event() override;
    /// Why the reference cannot be shown; empty if it can, and without one.
    std::string reference_problem() const;

private:
    using Done = std::function<void(Reply)>;

    Reply state();
    Reply pixel(const Request& request);
    /// The pixels that owe most to one pass, or the brightest pass of one pixel.
    void worst(const Request& request, const Done& done);
    void set_view(const nlohmann::json& body);
    void reload();
    void difference(const Request& request, const Done& done);
    void gain(const Request& request, const Done& done);
    Reply techniques(const Request& request);
    void image(const Request& request, const Done& done);
    void run(const nlohmann::json& body, const Done& done);
    void open(const nlohmann::json& body, const Done& done);
    /// Opens an image whose file is the body, or removes one.
    void images(Request request, const Done& done);
    /// The image of a run, of a view of an opened image, or of the denoised image of a run; nullptr where there is none yet.
    std::shared_ptr<const Snapshot> shown(const std::string& run_or_view);
    void save(const nlohmann::json& body, const Done& done);
    Reply get_paths(const Request& request);
    Reply put_paths(const Request& request);
    void probe(const Request& request, const Done& done);
    /// Of a method of which only whole passes can be traced again.
    void replay_last_pass(int run, uint64_t pixel, size_t most, const Done& done);
    /// The paths of the pass or, if it is not kept what it is made from, of the last one; of a worker.
    Reply replay_whole_pass(int run, uint32_t pass, uint64_t pixel, size_t most);
    /// What the session answers; of a worker.
    template <class Answer>
    Answer answer_of(const std::function<void(std::function<void(const Answer&)>)>& ask) const;
    void replay_pixel(const nlohmann::json& body, const Done& done);
    /// Calls `task`, which may throw, in a worker.
    static void later(Workers& workers, const Done& done, std::function<Reply()> task);
    /// Sends an image that a worker makes.
    template <class Make>
    void send(const Done& done, const Make& make);

    RunRequest run_request(const nlohmann::json& body) const;
    std::shared_ptr<const Scene> scene() const;
    std::shared_ptr<SceneData> data();
    std::vector<std::string> folders() const;
    std::string paths_in(const std::string& name) const;
    void look_at_scene_file();

    Session& session_;
    const ApiOptions options_;
    OpenedImages opened_;
    std::string scene_folder_;
    SceneView view_;
    double charged_ = 0;  ///< Processor time of the server's thread that was charged to snapshots.

    std::chrono::steady_clock::time_point looked_{};
    std::string scene_file_version_;  ///< As it was loaded.
    bool is_scene_changed_ = false;
    uint64_t own_revision_ = 0;
    std::atomic<bool> is_ended_{false};

    std::mutex data_mutex_;
    std::shared_ptr<SceneData> data_;
    // The last members: their tasks end before the others are destroyed. Images do not wait for longer tasks.
    Workers workers_{2}, image_workers_{1};
    DenoisedImages denoised_;
};

}  // namespace etendue

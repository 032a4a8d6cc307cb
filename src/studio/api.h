#pragma once
// The protocol between page and session, version 1: JSON, and binary images and geometry.

#include <atomic>
#include <chrono>
#include <map>
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
#include "studio/http.h"
#include "studio/scene_data.h"

namespace etendue {

struct ApiOptions {
    std::string token;
    std::string scene_file;
    std::string output_folder;          ///< Where images and paths are saved.
    std::optional<RgbImage> reference;  ///< Of the size of the image.
};

class Api final : public Handler {
public:
    Api(Session& session, ApiOptions options);

    void handle(const Request& request, std::function<void(Reply)> done) override;
    bool is_events(const Request& request, std::optional<Reply>& refused) override;
    uint64_t revision() override;
    std::string event() override;

private:
    using Done = std::function<void(Reply)>;

    Reply state();
    Reply pixel(const Request& request);
    void difference(const Request& request, const Done& done);
    void gain(const Request& request, const Done& done);
    Reply techniques(const Request& request);
    void image(const Request& request, const Done& done);
    Reply run(const nlohmann::json& body);
    void save(const nlohmann::json& body, const Done& done);
    Reply get_paths(const Request& request);
    Reply put_paths(const Request& request);
    void probe(const Request& request, const Done& done);
    void replay_pixel(const nlohmann::json& body, const Done& done);
    /// Calls `task`, which may throw, in a worker.
    void later(const Done& done, std::function<Reply()> task);

    RunRequest run_request(const nlohmann::json& body) const;
    std::shared_ptr<const Scene> scene() const;
    std::shared_ptr<SceneData> data();
    std::vector<std::string> folders() const;
    std::string paths_text(const std::string& name) const;
    void look_at_scene_file();

    Session& session_;
    const ApiOptions options_;
    std::string scene_folder_;
    double charged_ = 0;  ///< Processor time of the server's thread that was charged to snapshots.

    std::chrono::steady_clock::time_point looked_{};
    std::string fingerprint_;  ///< Of the scene's file as it was loaded.
    bool is_scene_changed_ = false;
    uint64_t own_revision_ = 0;
    std::map<std::string, uint64_t> paths_versions_;

    std::mutex data_mutex_;
    std::shared_ptr<SceneData> data_;
    Workers workers_;  ///< The last member: its tasks end before the others are destroyed.
};

}  // namespace etendue

// The page of supertac-collect: it shows the run and can end it, and nothing else.
#include "tests/apps/common/expect.h"
#include "tests/apps/rig/collect_run.h"
#include "tests/apps/web/http_client.h"
#include "tests/support/test.h"

namespace supertac::collect_page_test {

TEST(CollectPage, ShowsTheRunAndItsButtonEndsItAsCtrlCDoes) {
  CollectRun run;
  const int port = free_port();
  const std::string number = std::to_string(port), host = "Host: 127.0.0.1:" + number + "\r\n";
  RunningProcess program("supertac-collect", run.arguments({"--web", number}));
  const std::unique_ptr<HttpClient> client = connect_when_up(port);
  ASSERT_TRUE(client);
  client->send("GET /events HTTP/1.1\r\n" + host + "\r\n");
  const auto hello = event_after(client->receive("\n\n"), "event: hello\ndata: ");
  EXPECT_EQ(hello["plate"], "3_Bumps");
  EXPECT_EQ(hello["passes"].get<std::vector<double>>(), std::vector<double>{0.5});
  ASSERT_TRUE(run.wait_for_contact(1, program));
  const auto act = [&](const std::string& action) {
    return status_of(port, "POST /" + action + " HTTP/1.1\r\nContent-Length: 0\r\n" + host +
                               "Origin: http://127.0.0.1:" + number +
                               "\r\nX-Token: " + hello["token"].get<std::string>() + "\r\n\r\n");
  };
  const std::string seen = client->receive("\"phase\":\"slide\"");
  EXPECT_TRUE(contains(seen, "\"lifted\":false"));
  for (const char* action : {"start", "move", "home", "record"}) EXPECT_EQ(act(action), 404) << action;
  EXPECT_EQ(act("stop"), 200);
  act("stop");  // an impatient hand
  const ProcessResult result = program.wait();
  EXPECT_EQ(result.code, 130) << result.error;
  const auto end = event_after(client->receive("what never comes"), "event: end\ndata: ");
  EXPECT_TRUE(end["outcome"].get<std::string>().starts_with("incomplete after 0 passes")) << end;
  run.wait_for_rest();
  EXPECT_GT(run.head().z, kLiftedZ - 0.1);
}

}  // namespace supertac::collect_page_test

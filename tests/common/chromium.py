"""A headless Chromium of Debian for tests."""
import os

from selenium import webdriver
from selenium.webdriver.chrome.service import Service


def browser(folder, *more):
    """With a profile in the folder, logs of its console and network, and WebGL by the processor."""
    options = webdriver.ChromeOptions()
    options.binary_location = "/usr/bin/chromium"
    for word in ("--headless=new", "--no-sandbox", "--disable-gpu", "--enable-unsafe-swiftshader", "--disable-dev-shm-usage", "--no-first-run", "--no-proxy-server",
                 "--disable-background-networking", "--disable-component-update", "--user-data-dir=" + os.path.join(folder, "profile"), *more):
        options.add_argument(word)
    options.set_capability("goog:loggingPrefs", {"browser": "ALL", "performance": "ALL"})
    made = webdriver.Chrome(options=options, service=Service("/usr/bin/chromedriver"))
    made.command_executor.client_config.timeout = 700  # a step of the page may take long while others use the processor
    made.set_script_timeout(600)
    made.set_page_load_timeout(600)
    return made
